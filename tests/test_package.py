"""What `import selfmotion` offers and what it leaves alone."""

import subprocess
import sys

import selfmotion as sm


def test_import_leaves_the_heavy_and_optional_packages_alone() -> None:
    code = (
        "import sys, selfmotion; "
        "print([name for name in ('meshcat', 'matplotlib', 'trimesh', 'yourdfpy', 'toppra', "
        "'typer', 'rich', 'scipy.integrate', 'pydantic', 'tomli_w', 'xacro', 'distributed') "
        "if name in sys.modules])"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == "[]"


def test_every_exported_name_exists_and_is_documented() -> None:
    assert sorted(sm.__all__, key=lambda name: (not name.isupper(), name)) == sm.__all__
    for name in sm.__all__:
        assert hasattr(sm, name)
        assert getattr(sm, name).__doc__, name


def test_the_one_liner() -> None:
    code = "import selfmotion as sm; p = sm.plan(sm.sample_problem()); print(p.report.cost)"
    result = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=True
    )
    assert float(result.stdout) < 10.5145
