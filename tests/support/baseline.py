"""Runs a command as a processor without AVX-512 would: other kernels, and so other roundings.

    python -m support.baseline pytest tests/planning

numba compiles for x86-64-v3 with the features of that level, OpenBLAS takes the kernels of Haswell,
and NumPy leaves out what is above that level. Costs and verdicts are the same then, bits are not:
who compares these of two computations sees it here, on a processor of any age that has AVX2.
"""

import os
import platform
import sys

# The features of the level x86-64-v3 as LLVM calls them.
FEATURES = (
    *("64bit", "avx", "avx2", "bmi", "bmi2", "cmov", "crc32", "cx16", "cx8", "f16c", "fma", "fxsr"),
    *(
        "lzcnt",
        "mmx",
        "movbe",
        "popcnt",
        "sahf",
        "sse",
        "sse2",
        "sse3",
        "sse4.1",
        "sse4.2",
        "ssse3",
    ),
    *("x87", "xsave"),
)


def environment() -> dict[str, str]:
    """Return the variables that ask for that level.

    Raises
    ------
    SystemExit
        The processor has no such level.
    """
    if platform.machine() in ("aarch64", "arm64"):
        # All of them have the same vectors; there is nothing to leave out.
        return {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}
    if platform.machine() not in ("x86_64", "AMD64"):
        sys.exit(f"a baseline is known of x86-64 and aarch64; this is {platform.machine()}")
    # The names are those of the NumPy that is installed, and of them what this processor has.
    from numpy._core._multiarray_umath import (  # type: ignore[attr-defined]
        __cpu_dispatch__ as dispatched,
        __cpu_features__ as features,
    )

    above = [name for name in dispatched if name.startswith(("X86_V4", "AVX512"))]
    above = [name for name in above if features.get(name)]
    return {
        "NUMBA_CPU_NAME": "x86-64-v3",
        "NUMBA_CPU_FEATURES": ",".join(f"+{name}" for name in FEATURES),
        "OPENBLAS_CORETYPE": "Haswell",
        "NPY_DISABLE_CPU_FEATURES": " ".join(above),
    }


if __name__ == "__main__":
    os.execvpe(sys.argv[1], sys.argv[1:], {**os.environ, **environment()})
