"""Exported C as MuJoCo's callback: the same forces, in microseconds, on any thread."""

from __future__ import annotations

import ctypes
import tempfile
from pathlib import Path
from typing import Any

from mckibben.errors import ModelError
from mckibben.export import export_c
from mckibben.export.programs import compile_c
from mckibben.simulators.installed import mujoco
from mckibben.simulators.pulling import Pulling

MOST = 256
"""Different muscles of a process in C."""

_HELPER = """
#include "muscle.h"

long mck_size(void);
void mck_start(void *self);
int mck_step(void *self, const double *in, double *out);

long mck_size(void) { return (long)sizeof(muscle_model); }
void mck_start(void *self) { muscle_init((muscle_model *)self); }
int mck_step(void *self, const double *in, double *out)
{
    return muscle_step((muscle_model *)self, in, out);
}
"""

_START = ctypes.CFUNCTYPE(None, ctypes.c_void_p)
_STEP = ctypes.CFUNCTYPE(ctypes.c_int, *[ctypes.c_void_p] * 3)
_BIAS = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int)


class _Told(ctypes.Structure):
    """What `actuator.c` calls a muscle."""

    _fields_ = (
        *(("start", ctypes.c_void_p), ("step", ctypes.c_void_p), ("size", ctypes.c_int)),
        *((name, ctypes.c_int) for name in ("along", "pressure", "shortening", "pulls_only")),
        *((name, ctypes.c_double) for name in ("share", "zero", "time_step")),
    )


class CompiledMuscle:
    """The C of a muscle, compiled.

    Parameters
    ----------
    pull : Pulling
    sample_time : float
        MuJoCo's time step [s].

    Attributes
    ----------
    size : int
        Of its memory, in numbers of 8 bytes.
    """

    def __init__(self, pull: Pulling, sample_time: float) -> None:
        self._pull, self._time = pull, sample_time
        with tempfile.TemporaryDirectory() as place:
            folder, helper = Path(place) / "muscle", Path(place) / "helper.c"
            library = Path(place) / "muscle.so"
            export_c(pull.block, folder, name="muscle", sample_time=sample_time)
            helper.write_text(_HELPER)
            sources = sorted((folder / "src").glob("*.c"))
            compile_c(
                [*sources, helper], library, options=[f"-I{folder / 'src'}", "-shared", "-fPIC"]
            )
            self._library = ctypes.CDLL(str(library))
        self.size = -(-int(self._library.mck_size()) // 8)

    def told(self, *, zero: float, pulls_only: bool) -> int:
        """Tell the callback of it, and return its number."""
        pull, number = self._pull, len(_kept)
        told = _Told(
            *(
                ctypes.cast(self._library[name], ctypes.c_void_p)
                for name in ("mck_start", "mck_step")
            ),
            *(self.size, pull.along, pull.pressure, pull.shortening, pulls_only),
            *(pull.share, zero, self._time),
        )
        if not _library().mck_muscle(number, ctypes.byref(told)):
            raise ModelError(
                f"there are more than {MOST} different muscles in C",
                remedy="start a process for others",
            )
        _kept.append(self)
        return number


_kept: list[CompiledMuscle] = []
_libraries: list[ctypes.CDLL] = []


def _library() -> ctypes.CDLL:
    """Return the callback's library, compiled once in a process."""
    if not _libraries:
        package = Path(mujoco.__file__).parent
        engine = next(iter(sorted(package.glob("libmujoco*"))), None)
        if engine is None:
            raise ModelError(
                "MuJoCo's library is not in its package", remedy="use muscles in Python"
            )
        with tempfile.TemporaryDirectory() as place:
            library = Path(place) / "actuator.so"
            source = Path(__file__).parent / "c" / "actuator.c"
            compile_c(
                [source, engine],
                library,
                options=["-isystem", str(package / "include"), "-shared", "-fPIC"],
            )
            _libraries.append(ctypes.CDLL(str(library)))
    return _libraries[0]


def callback() -> Any:
    """Return the callback in C."""
    if not _callbacks:
        _callbacks.append(_BIAS(("mck_bias", _library())))
    return _callbacks[0]


_callbacks: list[Any] = []


def install(ours: Any) -> None:
    """Let MuJoCo call ours.

    Raises
    ------
    ModelError
        If another callback is there, whose actuators would lose it.
    """
    now = mujoco.get_mjcb_act_bias()
    if now is not None and now is not ours:
        raise ModelError(
            "actuators of this process have another callback already",
            remedy="have all muscles in C or all in Python; or "
            "mujoco.set_mjcb_act_bias(None), where the others are done with",
        )
    mujoco.set_mjcb_act_bias(ours)
