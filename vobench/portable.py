"""Restricts libraries to instructions that give equal bytes on all x86-64 processors.

Libraries select their code by the features of the processor, and sums then round differently. With VOBENCH_PORTABLE=1
they are restricted to SSE4, which every x86-64 processor has. Embree, which reads no variable, is restricted in
`vobench.rendering.portable_embree`. The variables must be set before the libraries load, so `vobench` sets them on
import.
"""

import os
import sys

from vobench.errors import InputError

PORTABLE = "VOBENCH_PORTABLE"
VARIABLES = {
    # Mesa's llvmpipe compiles shaders for the processor it runs on.
    "GALLIUM_OVERRIDE_CPU_CAPS": "sse4.1",
    "LP_NATIVE_VECTOR_WIDTH": "128",
    "OPENCV_CPU_DISABLE": "AVX512-SKX,AVX2,FMA3,FP16,AVX",
    "OPENCV_IPP": "disabled",
    "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX512_SPR",
    "OPENBLAS_CORETYPE": "Nehalem",
    # Numba compiles the kernels of the bake for the processor it runs on.
    "NUMBA_CPU_NAME": "nehalem",
    "NUMBA_CPU_FEATURES": "+sse4.1,+sse4.2",
}
LOADED_TOO_EARLY = ("numpy", "cv2")


def is_portable() -> bool:
    """Whether VOBENCH_PORTABLE requests bytes that do not depend on the processor."""
    return os.environ.get(PORTABLE, "") not in ("", "0")


def hold() -> None:
    """Set the variables for libraries that load later, in this process and its child processes."""
    is_too_late = any(name in sys.modules for name in LOADED_TOO_EARLY)
    if is_portable() and not is_too_late:
        os.environ.update(VARIABLES)


def require_held() -> None:
    """Raise InputError if VOBENCH_PORTABLE is set, but libraries were loaded before it could take effect."""
    are_set = all(os.environ.get(name) == value for name, value in VARIABLES.items())
    if is_portable() and not are_set:
        raise InputError(f"{PORTABLE} takes effect only if it is set, and vobench imported, before numpy and OpenCV")
