"""Files that were right once: good ones of each kind, and what becomes of them on the way."""

import io
import json
import re
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

import selfmotion as sm
from selfmotion.shell.documents import parse_setting, plan_request_of, set_key
from support.files_of_people import finger, with_arguments_text

# Numbers that no file means, and tokens that stand where numbers should.
_ODD = (
    *("nan", "inf", "-inf", "1e309", "-1e308", "1e300", "1e-320", "0", "-1", "-0.0", "1e19"),
    *("9" * 400, "9" * 5000, "0x10", "1_000", "1,5", "", "null", "true", "~", "[]", "{}", '""'),
    *("1j", "٣", "${x}", "*a", "- -", "2001-01-01", "0o7", "!!python/name:os.system", "<a/>"),
)
_TOKEN = re.compile(rb"[A-Za-z_]\w*|-?\d+\.?\d*(?:e-?\d+)?|[^\s\w]")
_NUMBER = re.compile(rb"-?\d+\.?\d*(?:e-?\d+)?")
_ENTITIES = (
    b'<!DOCTYPE robot [<!ENTITY a "'
    + b"a" * 1000
    + b'">'
    + b"".join(b'<!ENTITY %c "%s">' % (98 + k, b"&%c;" % (97 + k) * 50) for k in range(8))
    + b"]>"
)
_ANCHORS = b"a: &a [x,x,x,x,x,x,x,x,x]\n" + b"".join(
    b"%c: &%c [%s]\n" % (98 + k, 98 + k, b",".join([b"*%c" % (97 + k)] * 9)) for k in range(9)
)
_DEEP = (b"[" * 20000, b'{"a":' * 20000, b"<a>" * 20000, b"- " * 5000, b"a.b" * 5000, b"(" * 5000)
_DEEP = (*_DEEP, b"<a>" * 3000 + b"</a>" * 3000, b"[" * 200 + b"]" * 200)


class Good(NamedTuple):
    """A file that can be read.

    Attributes
    ----------
    kind : str
        What it is of, as the counts call it.
    suffix : str
    content : bytes
    read : callable
        Reads such a file.
    """

    kind: str
    suffix: str
    content: bytes
    read: Callable[[Path], object]


# Tables without headers, in other units and forms, printers' programs and rotary tables.
_OTHERS = (
    (".txt", "x [mm] y [mm] z [mm]\n400 -50 300\n420 0 300\n400 50 300\n"),
    (".csv", "x;y;z\n0,4;-0,05;0,3\n0,42;0;0,3\n0,4;0,05;0,3\n"),
    (".csv", "# X,Y,Z,NX,NY,NZ\n0.4,0,0.3,0,0,-1\n0.4,0.1,0.3,0,0,-1\n"),
    (".gcode", "M82\nG28\nG92 E0\nG1 F200 E3\nG0 X1 Y1 Z0.3\nG1 F600 X9 Y1 E4\nG1 X9 Y9 E5\nM84\n"),
    (".cls", "UNITS/MM\nRAPID\nGOTO/10,0,5\nFEDRAT/600\nCIRCLE/20,0,0,0,0,1,10,1,1,5,0,TIMES,2"
     "\nGOTO/30,0,5\nTLAXIS/0,0,1\nINDIRV/1,0,0\nTLON,GOFWD/ (CIRCLE/30,5,5,5),ON,(LINE/30,5,5,"
     "35,5,5)\nFINI\n"),
    (".ncl", "RAPID\nGOTO/0,0,9\nCYCLE/DEEP,FEDTO,5,STEP,2,RAPTO,1\nGOTO/9,0,0\nCYCLE/OFF\n"),
    (".tap", "G0 X0 Y0 Z20\nG99 G83 X10 Y0 Z-5 R2 Q3 F120\nG80\nG0 Z50\nM30\n"),
    (".json", '{"waypoints": [{"position": [0.4, 0, 0.3], "rpy": [3.1, 0, 0]}, {"position": [0.5, '
     '0, 0.3], "rpy": [3.1, 0, 0]}]}'),
    (".nc", "G28\nG0 X0 Y0 Z0\nG93\nG1 X9 F30\nG18 G2 X19 Z0 I5 K0 F30\n"),
    (".nc", "G28\nG43.4\nG1 F800 X0 Y0 Z9 B30 C0\nG1 X9 Y1 B25 C5\nG1 X9 Y9 B20\nG1 E-1\nG28 X0\n"),
    (".yaml", "- dwell: 0\n  paths:\n  - header: {frame_id: 0}\n    poses:\n"
     + "".join(f"    - {{position: {{x: 0.4, y: {y}, z: 0.3}}, orientation: {{x: 1, y: 0, z: 0, w: "
               "0}}\n" for y in (0, 0.1, 0.2))),
    (".json", '[{"poses": [{"position": {"x": 0.4, "y": 0, "z": 0.3}, "orientation": {"x": 1, '
     '"y": 0, "z": 0, "w": 0}}, {"position": {"x": 0.5, "y": 0, "z": 0.3}, "orientation": {"x": 1, '
     '"y": 0, "z": 0, "w": 0}}]}]'),
    (".csv", "x, y, z, rz1, ry, rz2, motion_type, velocity\n0, 0, 0, 0, 180, 0, 0, 50\n50, 0, 0, "
     "0, 180, 0, 0, 50\n"),
    (".csv", "X 0.00; Y 0.00; Z 0.00; A 180.0; B 0.0; C 0.0\nX 50.00; Y 0.00; Z 0.00; A 1; B 0"),
    (".csv", 'breakpoints,primitives,points,q_bp\n0,movej_fit,"[array([450.0, -100.0, 350.0])]","a'
     '\nb"\n500,movel_fit,"[array([450.0, 0.0, 350.0])]",\n'),
    (".json", '{"layer_0": {"path_0": {"0": {"frame": {"point": [0, 0, 0], "xaxis": [1, 0, 0], '
     '"yaxis": [0, -1, 0]}, "velocity": 25}, "1": {"frame": {"point": [9, 0, 0], "xaxis": [1, 0, '
     '0], "yaxis": [0, -1, 0]}, "velocity": 25, "extruder_toggle": false}}}}'),
    (".cls", "MSYS/0,0,0,1,0,0,0,1,0\nRAPID\nGOTO/0,0,20,0,0,1\nFEDRAT/MMPM,600\nGOTO/0,0,0\nMSYS/"
     "9,0,0,0,1,0,-1,0,0\nOFSTNO/1\nINSERT M8\nGOTO/40,0,0\nRAPID\nGOTO/40,0,20\n"),
    (".csv", "x;y;z;rz1;ry;rz2;velocity\n0;0;0;0;180;0;20\n40;0;0;90;180;0;20\n"),
    (".csv", "X 10,5; Y 0,0; Z 3,25; A 180,0\nX 30,5; Y -4,0; Z 3,25; A 180,0\n"),
    (".json", '{"dtype": "a", "data": [{"point": [0.4, 0, 0.3], "xaxis": [1, 0, 0], "yaxis": '
     '[0, -1, 0]}, {"point": [0.4, 0.1, 0.3], "xaxis": [1, 0, 0], "yaxis": [0, -1, 0]}]}'),
    (".mpf", "TRAORI\nG0 X=0 Y=0 Z=20 A3=0 B3=0 C3=1\nG1 X=40 Z=0 A3=0.1 B3=0 C3=0.9 F2000\n"),
)  # fmt: skip
_PLANAR = b"""<robot name="r"><link name="a"/><link name="b"/><joint name="p" type="planar">
<parent link="a"/><child link="b"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" velocity="1"/>
</joint></robot>"""
_SRDF_XACRO = b"""<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="arm">
<xacro:arg name="p" default="l"/><xacro:property name="n" value="${1 + 1}"/>
<disable_collisions link1="$(arg p)1" link2="l${n}"/></robot>"""
_POINTS = b"""joint_names: [a, b]
points:
- {positions: [0, 1], velocities: [], time_from_start: {secs: 0, nsecs: 0}}
- {positions: [0.1, 1], velocities: [], time_from_start: {secs: 1, nsecs: 0}}
- {positions: [0.2, 2], velocities: [], time_from_start: {secs: 2, nsecs: 5}}
"""


def _others(file: Path) -> object:
    return sm.files.read_path(file, feed=0.05, corners="round")


def _along(file: Path) -> object:
    return sm.files.read_path(file, feed=0.05, corners="round", along="x", lead=0.1)


def _drawn_in_mm(file: Path) -> object:
    return sm.files.read_path(file, feed=0.05, unit="mm")


def _expanded(file: Path) -> object:
    return sm.load_robot(file, tool="l7", arguments={"name": "arm", "reach": "0.3"})


@cache
def good_files() -> tuple[Good, ...]:
    """Return files of all kinds, the same whenever they are made."""
    arm = sm.load_robot("planar_3r")
    problem = sm.sample_problem()
    plan = sm.plan(problem, max_evaluations=2)
    found = [
        Good("URDF", ".urdf", arm.urdf.bare_text().encode(), sm.load_robot),
        Good("URDF", ".urdf", _URDF, sm.load_robot),
        *(Good(_kind(suffix), suffix, content, _path) for suffix, content in _paths()),
        *(Good("others' files", suffix, text.encode(), _others) for suffix, text in _OTHERS),
        Good("others' files", ".csv", b"x,y,z\n0,0,0\n0.1,0,0\n0.1,0.08,0\n0,0.08,0\n", _along),
        Good("others' files", ".dxf", _drawing(unit=0), _drawn_in_mm),
        Good("URDF", ".urdf", _PLANAR, sm.load_robot),
        Good("SRDF", ".srdf", _SRDF_XACRO, lambda file: sm.constraints.Clearance(srdf=file)),
        Good("xacro", ".xacro", with_arguments_text().encode(), _expanded),
        Good("URDF", ".urdf", finger().encode(), lambda file: sm.load_robot(file, tool="tip")),
        Good("motion", ".yaml", _POINTS, sm.files.read_motion),
        Good("SRDF", ".srdf", _SRDF, lambda file: sm.constraints.Clearance(srdf=file)),
        Good("obstacles", ".json", json.dumps(_OBSTACLES, indent=1).encode(), _obstacles),
        Good("obstacles", ".toml", _OBSTACLES_TOML, _obstacles),
        Good("limits", ".yaml", _LIMITS, lambda file: sm.files.read_joint_limits(file, arm)),
    ]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for suffix in (".csv", ".npz", ".json", ".yaml"):
            sm.files.write_motion(plan, folder / f"motion{suffix}", rate=10.0)
            content = (folder / f"motion{suffix}").read_bytes()
            found.append(Good("motion", suffix, content, sm.files.read_motion))
        limits = [sm.constraints.JointAccelerationLimits([9.0] * 3)]
        ends = np.zeros(3), np.array([0.4, 0.3, -0.5])
        move = sm.move(arm, *ends, constraints=limits, clearance=None)
        for suffix in (".src", ".mod"):
            sm.files.write_motion(
                move, folder / f"motion{suffix}", settings=sm.files.ProgramSettings(mass=1.0)
            )
            content = (folder / f"motion{suffix}").read_bytes()
            found.append(Good("program", suffix, content, sm.files.read_motion))
        found += _pose_programs(folder)
        for suffix in (".toml", ".json"):
            sm.files.write_problem(problem, folder / f"problem{suffix}")
            content = (folder / f"problem{suffix}").read_bytes()
            found.append(Good("problem", suffix, content, sm.read_problem))
        found.append(Good("problem", ".toml", _PROBLEM, sm.read_problem))
        plan.save(folder / "plan.npz")
        content = (folder / "plan.npz").read_bytes()
        found += [Good("plan", ".npz", content, sm.load_plan)] * 2
        seam = sm.Seam("seam", problem.path, problem.task)
        sm.plan_job(arm, [seam], branches=1, clearance=None).save(folder / "a.program")
        sm.plan_in_parts(problem).save(folder / "a.parts")
        for suffix, read in ((".program", sm.load_program), (".parts", sm.files.load_parts)):
            content = (folder / f"a{suffix}").read_bytes()
            found += [Good("several plans", suffix, content, read)] * 2
    return tuple(found)


def _pose_programs(folder: Path) -> list[Good]:
    """Return linear programs of a short move, whose poses the arm's kinematics have to follow."""
    ur5 = sm.load_robot("ur5")
    first = ur5.dexterous_configuration("pointing")
    move = sm.move(ur5, first, first + 0.05, clearance=None)
    asked = sm.files.ProgramSettings(mass=1.0, targets="poses")
    found = []
    for suffix in (".src", ".mod", ".script"):
        sm.files.write_motion(move, folder / f"poses{suffix}", settings=asked)
        content = (folder / f"poses{suffix}").read_bytes()
        read = partial(sm.files.read_motion, robot=ur5)
        found.append(Good("program of poses", suffix, content, read))
    return found


def mutated(good: Good, rng: np.random.Generator) -> bytes:
    """Return the content of a file, changed in one to three ways."""
    content = good.content
    packed = good.suffix in (*_ARCHIVES, ".npy")
    if good.suffix in _ARCHIVES and rng.random() < 0.75:
        return _repacked(content, rng)
    if good.suffix == ".npy" and rng.random() < 0.5:
        return _announced(content, rng)
    for _ in range(int(rng.integers(1, 4))):
        ways = _BYTES if packed else (*_BYTES, *_TEXT)
        content = ways[int(rng.integers(len(ways)))](content, rng)
    return content


def _flip(content: bytes, rng: np.random.Generator) -> bytes:
    changed = bytearray(content)
    for _ in range(int(rng.integers(1, 9)) if changed else 0):
        changed[int(rng.integers(len(changed)))] = int(rng.integers(256))
    return bytes(changed)


def _cut(content: bytes, rng: np.random.Generator) -> bytes:
    return content[: int(rng.integers(len(content) + 1))]


def _hole(content: bytes, rng: np.random.Generator) -> bytes:
    first, last = np.sort(rng.integers(len(content) + 1, size=2))
    return content[:first] + content[last:]


def _nul(content: bytes, rng: np.random.Generator) -> bytes:
    return _put(content, b"\0" * int(rng.integers(1, 9)), rng)


def _encoded(content: bytes, rng: np.random.Generator) -> bytes:
    text = content.decode("utf-8", "replace")
    text = text.replace("a", "ä", 1)
    name = ("utf-16", "utf-8-sig", "latin-1", "utf-32", "utf-7")[int(rng.integers(5))]
    return text.encode(name, "replace")


def _put(content: bytes, inserted: bytes, rng: np.random.Generator) -> bytes:
    at = int(rng.integers(len(content) + 1))
    return content[:at] + inserted + content[at:]


def _lines(content: bytes, rng: np.random.Generator) -> bytes:
    """Delete, double or swap lines."""
    lines = content.split(b"\n")
    first, second = (int(k) for k in rng.integers(len(lines), size=2))
    match int(rng.integers(4)):
        case 0:
            del lines[first]
        case 1:
            lines.insert(second, lines[first])
        case 2:
            lines[first], lines[second] = lines[second], lines[first]
        case 3:
            lines[first:first] = [lines[first]] * int(rng.integers(2, 200))
    return b"\n".join(lines)


def _tokens(content: bytes, rng: np.random.Generator) -> bytes:
    """Put another of its tokens where one was."""
    found = list(_TOKEN.finditer(content[:100_000]))
    if not found:
        return content
    at, other = (found[int(k)] for k in rng.integers(len(found), size=2))
    return content[: at.start()] + other.group() + content[at.end() :]


def _number(content: bytes, rng: np.random.Generator) -> bytes:
    found = list(_NUMBER.finditer(content[:100_000]))
    if not found:
        return content
    at = found[int(rng.integers(len(found)))]
    odd = _ODD[int(rng.integers(len(_ODD)))].encode()
    return content[: at.start()] + odd + content[at.end() :]


def _long(content: bytes, rng: np.random.Generator) -> bytes:
    return _put(content, b"x" * int(rng.integers(1000, 200_000)), rng)


def _deep(content: bytes, rng: np.random.Generator) -> bytes:
    nested = _DEEP[int(rng.integers(len(_DEEP)))]
    found = list(_NUMBER.finditer(content[:100_000]))
    if not found or rng.random() < 0.3:
        return _put(content, nested, rng)
    at = found[int(rng.integers(len(found)))]
    return content[: at.start()] + nested + content[at.end() :]


def _bomb(content: bytes, rng: np.random.Generator) -> bytes:
    """Let few characters stand for very many."""
    if b"<robot" in content:
        text = content[content.index(b"<robot") :]
        found = list(re.finditer(rb'="[^"]*"|>\s*<', text))
        at = found[int(rng.integers(len(found)))] if found else None
        if at is None:
            return content
        name = b"&%c;" % int(rng.integers(97, 106))
        inner = b'="' + name + b'"' if at.group()[:1] == b"=" else b">" + name + b"<"
        return _ENTITIES + text[: at.start()] + inner + text[at.end() :]
    return _ANCHORS + content


# Suffixes of archives of several members.
_ARCHIVES = (".npz", ".program", ".parts")
_BYTES = (_flip, _cut, _hole, _nul)
_TEXT = (_encoded, _lines, _lines, _tokens, _tokens, _tokens, _number, _number, _number)
_TEXT = (*_TEXT, _long, _deep, _bomb)


def _repacked(content: bytes, rng: np.random.Generator) -> bytes:
    """Change a member of an archive, so that the archive itself is sound."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    names = list(members)
    name, other = (names[int(k)] for k in rng.integers(len(names), size=2))
    match int(rng.integers(7)):
        case 0:
            del members[name]
        case 1:
            members[name], members[other] = members[other], members[name]
        case 2 if name.endswith(".npy"):
            members[name] = _announced(members[name], rng)
        case 3:
            members[name] = _flip(members[name], rng)
        case 4:
            return _zip_bomb(name)
        case _ if "bundle.json" in members:
            members["bundle.json"] = _worded(members["bundle.json"], rng)
        case _:
            name = "description.npy" if "description.npy" in members else name
            members[name] = _described(members[name], rng)
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for member, values in members.items():
            archive.writestr(member, values)
    return out.getvalue()


def _described(member: bytes, rng: np.random.Generator) -> bytes:
    """Change the text that an array of bytes holds, or numbers of one that holds numbers."""
    array = np.load(io.BytesIO(member))
    if array.dtype == np.uint8:
        array = np.frombuffer(_worded(array.tobytes(), rng), np.uint8)
    elif array.size and array.dtype.kind == "f":
        array = array.copy()
        array.flat[int(rng.integers(array.size))] = rng.choice([np.nan, np.inf, 1e300, -1.0])
    else:
        array = array[: int(rng.integers(len(array) + 1))] if array.ndim else array
    out = io.BytesIO()
    np.save(out, array)
    return out.getvalue()


def _worded(text: bytes, rng: np.random.Generator) -> bytes:
    """Change words and numbers of a text."""
    for _ in range(int(rng.integers(1, 3))):
        text = (_tokens, _number, _number, _deep)[int(rng.integers(4))](text, rng)
    return text


_SHAPES = ("(1000000000,)", "(9000000000000000000, 9)", "(-1,)", "()", "(0, 0)", "(3, 1, 1, 1)")
_TYPES = ("|O", "<f2", "<c16", "<U1000000", "<M8[s]", "|V0", "<f16", ">f8", "<i8", "|b1")


def _announced(member: bytes, rng: np.random.Generator) -> bytes:
    """Let the head of an array announce another shape or type than its body has."""
    shape = _SHAPES[int(rng.integers(len(_SHAPES)))].encode()
    kind = _TYPES[int(rng.integers(len(_TYPES)))].encode()
    if rng.random() < 0.5:
        head = re.sub(rb"'shape': \([^)]*\)", b"'shape': " + shape, member[10:])
    else:
        head = re.sub(rb"'descr': '[^']*'", b"'descr': '" + kind + b"'", member[10:])
    before = member[10:].index(b"\n") + 1
    after = head.index(b"\n") + 1
    return member[:8] + after.to_bytes(2, "little") + head if before else member


def _zip_bomb(name: str) -> bytes:
    """Return an archive of a megabyte whose one member has a gigabyte."""
    packed, check, size = _packed_gigabyte()
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr(name, packed)
    content = bytearray(out.getvalue())
    # What was stored is said to be deflated, before the member and in the directory at the end.
    for head in (0, content.rindex(b"PK\x01\x02") + 2):
        struct.pack_into("<H", content, head + 8, zipfile.ZIP_DEFLATED)
        struct.pack_into("<L", content, head + 14, check)
        struct.pack_into("<L", content, head + 22, size)
    return bytes(content)


@cache
def _packed_gigabyte() -> tuple[bytes, int, int]:
    """Return an array of zeros as it is deflated, its CRC-32 and its size."""
    chunk, head = b"\0" * (1 << 24), io.BytesIO()
    described = {"descr": "<f8", "fortran_order": False, "shape": (8 * len(chunk),)}
    np.lib.format.write_array_header_1_0(head, described)
    packer, packed, check, size = zlib.compressobj(1, zlib.DEFLATED, -zlib.MAX_WBITS), b"", 0, 0
    for part in (head.getvalue(), *[chunk] * 64):
        packed += packer.compress(part)
        check, size = zlib.crc32(part, check), size + len(part)
    return packed + packer.flush(), check, size


def _kind(suffix: str) -> str:
    kinds = {".nc": "cut", ".apt": "cut", ".dxf": "drawing"}
    return kinds.get(suffix, "path")


# Arms of problems, which are loaded once.
_arms: dict[str, object] = {}


def _obstacles(file: Path) -> object:
    """Read obstacles as `--set clearance.obstacles=@FILE` does."""
    document = {
        "robot": {"name": "panda"},
        "path": {"kind": "circle", "radius": 0.1, "normal": [0, 0, 1], "duration": 2.0},
        "start": "dexterous",
        "clearance": {"distance": 0.01},
    }
    set_key(document, *parse_setting(f"clearance.obstacles=@{file}", file.parent))
    return plan_request_of(document, file, cache=_arms).problem.clearance


def _path(file: Path) -> object:
    """Read a path, and draw it: what is wrong with it must be said before it is followed."""
    try:
        path = sm.files.read_path(file)
    except sm.errors.FileFormatError as error:
        if not re.search("has no times|says no feed", str(error)):
            raise
        path = sm.files.read_path(file, feed=0.1)
    return path.samples([0.0, 0.5 * path.duration, path.duration])


def _paths() -> list[tuple[str, bytes]]:
    """Return paths of all kinds of files."""
    t = np.linspace(0.0, 2.0, 9)
    table = np.stack([t, 0.1 * t, 0.05 * np.sin(t), 0.0 * t], axis=1)
    turned = np.hstack([table, np.tile([1.0, 0.0, 0.0, 0.0], (len(t), 1))])
    rows = [",".join(f"{value:.6g}" for value in row) for row in turned.tolist()]
    found = [(".csv", "\n".join(["t,x,y,z,qw,qx,qy,qz", *rows, ""]).encode())]
    rows = [";".join(f"{1e3 * v:.6g}" for v in row[1:]) + ";0;0;90" for row in table.tolist()]
    head = "x_mm;y_mm;z_mm;roll_deg;pitch_deg;yaw_deg"
    found.append((".csv", "\n".join(["# seam", head, *rows, ""]).encode()))
    poses = [
        {
            "header": {"stamp": {"sec": int(row[0]), "nanosec": int(1e9 * (row[0] % 1.0))}},
            "pose": {
                "position": dict(zip("xyz", row[1:], strict=True)),
                "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
            },
        }
        for row in table.tolist()
    ]
    import yaml

    found.append((".yaml", yaml.safe_dump({"poses": poses}).encode()))
    bare = [pose["pose"] for pose in poses]
    found.append((".json", json.dumps({"header": {}, "poses": bare}, indent=1).encode()))
    for array in (table[:, :4], table[:, 1:4], np.tile(np.eye(4), (3, 1, 1)) + 0.0):
        if array.ndim == 3:
            array[:, 0, 3] = [0.0, 0.1, 0.2]
        out = io.BytesIO()
        np.save(out, array)
        found.append((".npy", out.getvalue()))
    found += [(".nc", _GCODE), (".apt", _CLDATA), (".csv", _SEAMS), (".dxf", _drawing())]
    return found


def _drawing(unit: int = 4) -> bytes:
    """Return a drawing of one stroke: a line, an arc, a polyline with a bulge, a spline."""
    entities = [
        "LINE 10 0 20 0 30 0 11 40 21 0 31 0",
        "ARC 10 40 20 10 30 0 40 10 50 270 51 0",
        "LWPOLYLINE 90 2 70 0 10 50 20 10 42 0.4 10 50 20 30",
        "SPLINE 70 8 71 3 72 8 73 4 74 0 40 0 40 0 40 0 40 0 40 1 40 1 40 1 40 1 "
        "10 50 20 30 30 0 10 50 20 40 30 0 10 60 20 50 30 5 10 70 20 50 30 5",
    ]
    said = f"0 SECTION 2 HEADER 9 $ACADVER 1 AC1015 9 $INSUNITS 70 {unit} 0 ENDSEC 0 SECTION 2 "
    said += "ENTITIES "
    for k, text in enumerate(entities):
        kind, _, rest = text.partition(" ")
        classes = {"LWPOLYLINE": "AcDbPolyline", "ARC": "AcDbCircle"}
        own = classes.get(kind, f"AcDb{kind.capitalize()}")
        if kind == "ARC":
            rest = rest.replace(" 50 270", " 100 AcDbArc 50 270")
        said += f"0 {kind} 5 {k + 64:X} 100 AcDbEntity 8 weld 100 {own} {rest} "
    return ("\n".join((said + "0 ENDSEC 0 EOF").split()) + "\n").encode()


_GCODE = b"""%
O1 (SLOT)
N10 G21 G90 G94 G43.4 G17 G54
G0 X0 Y0 Z5 M3
G1 Z-2 F600
X40 F1200
G3 X41 Y1 I0 J1
G2 X42 Y2 R1
G1 Y50 B15 A-3 C40
Y60 I0 J0.1 K1
G91
G1 Z5.5
M30
"""
_CLDATA = b"""PARTNO/SLOT
UNITS/MM
LOADTL/1 $$ a ball
FROM/0,0,50
RAPID
GOTO/0,0,5
FEDRAT/600,MMPM
GOTO/0,0,-2,0,0,1
COOLNT/ON
GOTO/40,0,-2
GOTO/40,50,-2,$
  0.258819045,0,0.965925826
GODLTA/0,0,7.5
FINI
"""
_SEAMS = b"""seam,x,y,z,feed,event
left,0,0,0,0.05,
left,0.05,0,0,0.05,arc on
left,0.1,0.02,0,0.03,"arc off"
"""
_SRDF = b"""<?xml version="1.0"?>
<robot name="arm">
  <group name="arm"><chain base_link="base" tip_link="tool"/></group>
  <disable_collisions link1="base" link2="link1" reason="Adjacent"/>
  <disable_collisions link1="link1" link2="link2" reason="Never"/>
</robot>
"""
_LIMITS = b"""default_velocity_scaling_factor: 0.5
default_acceleration_scaling_factor: 0.5
joint_limits:
  joint1:
    has_position_limits: true
    min_position: -2.0
    max_position: 2.0
    has_velocity_limits: true
    max_velocity: 1.5
  joint2:
    has_acceleration_limits: true
    max_acceleration: 4.0
    has_jerk_limits: false
"""
_OBSTACLES = [
    {"shape": "box", "name": "post", "position": [1, 0, 0], "size": [0.1, 0.1, 1.2]},
    {"shape": "sphere", "name": "ball", "position_mm": [10, 20, 30], "radius_mm": 50},
    {"shape": "cylinder", "name": "can", "position": [0, 1, 0], "rpy": [0, 0, 1],
     "radius": 0.1, "length": 0.3},
]  # fmt: skip
_OBSTACLES_TOML = b"""[[obstacles]]
shape = "capsule"
name = "rail"
position = [1.0, 0.0, 0.2]
rpy_deg = [0, 90, 0]
radius = 0.05
length_mm = 500
"""
_PROBLEM = b"""task = "planar"
start = "dexterous"
rest = true
max_evaluations = 20

[robot]
name = "planar_3r"
lock = { }

[robot.base]
position_mm = [0, 0, 100]
rpy_deg = [0, 0, 90]

[path]
kind = "circle"
radius = 0.1
normal = [0, 0, 1]
duration = 4

[[costs]]
kind = "JointVelocity"

[[costs]]
kind = "InverseManipulability"
mu = 0.01

[[constraints]]
kind = "JointPositionLimits"
margin_deg = 5

[search]
starts = 4
"""
_LINK = """<link name="link{k}"><inertial><origin xyz="0 0 0.1" rpy="0 0 0"/><mass value="1.5"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="0 0 0.1"/><geometry><cylinder radius="0.05" length="0.2"/></geometry>
</collision></link>
<joint name="joint{k}" type="{kind}"><origin xyz="0 0 0.2" rpy="0 0.1 0"/><parent link="{parent}"/>
<child link="link{k}"/><axis xyz="0 {k} 1"/><limit lower="-2" upper="2" velocity="2" effort="50"/>
<dynamics damping="0.1" friction="0"/></joint>
"""
_URDF = (
    '<?xml version="1.0"?>\n<robot name="arm">\n<link name="base"/>\n'
    + "".join(
        _LINK.format(k=k, kind=kind, parent="base" if k == 1 else f"link{k - 1}")
        for k, kind in enumerate(("revolute", "continuous", "prismatic", "revolute"), 1)
    )
    + '<link name="finger"><visual><geometry><mesh filename="finger.stl" scale="1 1 1"/></geometry>'
    '</visual></link>\n<joint name="grip" type="fixed"><parent link="link4"/>'
    '<child link="finger"/></joint>\n</robot>\n'
).encode()
