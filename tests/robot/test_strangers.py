"""Files of strangers: expressions run no code, and names put no line into programs."""

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest
import yaml

import selfmotion as sm
from selfmotion.model.robot.xacro_expressions import (
    ExpressionError,
    check_expression,
    only_arithmetic,
)
from selfmotion.shop.controllers.mujoco_keyframes import keyframes
from selfmotion.shop.controllers.program_texts import as_word, of_word
from support.files_of_people import arm, chain_elements

HEAD = '<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">'
# Ways past what xacro forbids, each of which would make a file of the name MARK.
_SYSTEM = "[c for c in ().__class__.__base__.__subclasses__() if c.__name__ == '_wrap_close'][0]"
CODE = {
    "a lambda": f"${{(lambda: {_SYSTEM}.__init__.__globals__['system']('touch MARK'))()}}",
    "a comprehension": "${[x.__class__ for x in [1]] and 1}",
    "a frame": "${[g.gi_frame.f_back.f_globals for g in [(x for x in [1])]] and 1}",
    "methods of a class": "${python.vars(python.type)['__subclasses__'](python.type(1))}",
    "classes": "${python.type('X', (), dict())}",
    "names of classes": "${list.mro()}",
    "a walrus": "${(x := 1)}",
}


@pytest.mark.parametrize("kind", CODE)
def test_expressions_of_xacro_run_no_code(kind: str, tmp_path: Path) -> None:
    mark, file = tmp_path / "made", tmp_path / "arm.xacro"
    text = CODE[kind].replace("MARK", str(mark)).replace("&", "&amp;").replace("<", "&lt;")
    value = text.replace('"', "&quot;")
    file.write_text(
        f'{HEAD}<xacro:property name="x" value="{value}"/><link name="x${{x}}"/>'
        f"{chain_elements()}</robot>"
    )
    with pytest.raises(sm.errors.RobotError, match=r"is code \(|not defined"):
        sm.load_robot(file)
    assert not mark.exists()


@pytest.mark.parametrize(
    "text", ["open('x', 'w')", "eval('1')", "getattr(1, 'real')", "(lambda: 1)()", "vars(1)"]
)
def test_arguments_run_no_code(text: str) -> None:
    """What stands in $(eval …) has all of Python's functions in xacro itself."""
    from xacro.substitution_args import resolve_args

    context = {"arg": {"reach": "0.5"}, "filename": "x"}
    with only_arithmetic(str):
        assert resolve_args("$(eval 2 * reach)", context) == "1.0"
        assert resolve_args("$(eval int(arg('reach') * 4) if true else pi)", context) == "2"
        with pytest.raises((ExpressionError, KeyError, NameError)):
            resolve_args(f"$(eval {text})", context)


def test_units_in_yaml_run_no_code_and_stay_with_xacro(tmp_path: Path) -> None:
    """`load_yaml` of xacro evaluates what has a unit, and adds that to the reader of YAML."""
    before = set(yaml.SafeLoader.yaml_constructors)
    (tmp_path / "sizes.yaml").write_text("height: !millimeters 300\nturn: !degrees 90\n")
    file = tmp_path / "arm.xacro"
    loaded = "${xacro.load_yaml('" + str(tmp_path / "sizes.yaml") + "')}"
    file.write_text(
        f'{HEAD}<xacro:property name="sizes" value="{loaded}"/>'
        f"{chain_elements('${sizes.height}')}</robot>"
    )
    assert sm.load_robot(file).pose([0.0] * 7).translation[2] == pytest.approx(0.3 + 6 * 0.15)
    assert set(yaml.SafeLoader.yaml_constructors) == before
    (tmp_path / "sizes.yaml").write_text("height: !meters '(lambda: 0.3)()'\n")
    with pytest.raises(sm.errors.RobotError, match=r"is code \(lambda\), which is never run"):
        sm.load_robot(file)


def test_what_people_write_is_evaluated(tmp_path: Path) -> None:
    file = tmp_path / "arm.xacro"
    file.write_text(
        HEAD + '<xacro:arg name="reach" default="0.1"/><xacro:property name="_lift" value="0.2"/>'
        '<xacro:property name="sizes" value="${dict(a=[0.1, 0.2], b=python.len(\'x\'))}"/>'
        '<xacro:property name="most" value="${max([x * 2 for x in sizes[\'a\']]) if True else 0}"/>'
        '<xacro:property name="far" value="$(eval 2 * reach if True else 0)"/>'
        + chain_elements("${_lift + most - 0.4 + far + radians(0) + sizes['b'] - 1}")
        + "</robot>"
    )
    assert sm.load_robot(file).pose([0.0] * 7).translation[2] == pytest.approx(0.4 + 6 * 0.15)
    for text in ("1 + 2 * pi", "'%.3f' % x", "f'{a}_{b}'", "x[0:2]", "not (a and b)", "f(*a, **b)"):
        check_expression(text)
    with pytest.raises(ExpressionError):
        check_expression("a.__class__")


@pytest.mark.parametrize("what", ["robot", "link", "joint"])
@pytest.mark.parametrize("letter", ["&#10;", "&#13;", "\x85", "\u2028", "&#9;"])
def test_names_are_one_line(what: str, letter: str, tmp_path: Path) -> None:
    text, name = arm(), {"robot": "arm", "link": "l3", "joint": "j4"}[what]
    evil = f"x{letter}set_standard_digital_out(3, True)"
    file = tmp_path / "arm.urdf"
    file.write_text(text.replace(f'"{name}"', f'"{evil}"'), encoding="utf-8")
    with pytest.raises(sm.errors.RobotError, match=rf"<{what}> has name=.*expected one line"):
        sm.load_robot(file)


@pytest.mark.parametrize(
    "name", ["j1", "joint 1", "gelenk_ä1", "axis,1", "rail/x", "50%", "%20", '"a"', "a\u00a0b", "-"]
)
def test_names_are_words_of_comments_and_come_back(name: str) -> None:
    word = as_word(name)
    assert word.isascii()
    assert len(word.split()) == 1
    assert "," not in word
    assert of_word(word) == name


def test_comments_of_keyframes_end_where_they_end(tmp_path: Path) -> None:
    file = tmp_path / "arm.urdf"
    file.write_text(arm().replace('"j4"', '"j --&gt;&lt;x/&gt;"'))
    robot = sm.load_robot(file)
    text = keyframes(robot, np.zeros(1), np.full((1, 7), 0.1), np.zeros((1, 7)))
    assert ElementTree.fromstring(text).tag == "mujoco"
    assert text.count("--") == 2
