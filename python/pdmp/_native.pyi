# Types of the compiled half. Its documentation lives with the code in crates/pdmp-py: see help().
#
# Shapes: M demonstrations, T samples, D degrees of freedom, J style parameters, Q context values,
# B trajectories, C samples of a regression with P outputs. Times are in s, positions in the unit of
# each degree of freedom. Whatever numpy can turn into float64 is accepted; float64 comes back.

from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from typing import Any, ClassVar, Literal, TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pdmp.realtime import Run

_Array: TypeAlias = NDArray[np.float64]
_Kind: TypeAlias = Literal["discrete", "rhythmic"]
_Map: TypeAlias = Literal["auto", "stacked", "gp", "linear", "polynomial"]
_Context: TypeAlias = ArrayLike | Sequence[float | str]
_Contexts: TypeAlias = ArrayLike | Sequence[Sequence[float | str]]
_Demo: TypeAlias = Demonstration | Trajectory | ArrayLike
_Demos: TypeAlias = Sequence[_Demo] | Mapping[str, _Demo] | ArrayLike
_Kernel: TypeAlias = Literal["matern32", "matern52"]

__all__ = [
    "ContextMap",
    "Controller",
    "Demonstration",
    "Factors",
    "FitError",
    "GP",
    "GPRegression",
    "Model",
    "ModelFileError",
    "NGnet",
    "NGnetRegression",
    "PdmpError",
    "Prediction",
    "RolloutChunks",
    "Status",
    "Trajectory",
    "Warp",
    "__version__",
    "cut",
    "cycles",
    "factorise",
    "fill",
    "fit",
    "inspected",
    "load",
    "lowpass",
    "period",
    "resample",
    "residuals",
    "trim",
]
__version__: str

class PdmpError(Exception): ...
class FitError(PdmpError): ...
class ModelFileError(PdmpError): ...

@final
class Demonstration:
    def __new__(
        cls,
        position: ArrayLike | Trajectory,  # (T, D)
        *,
        dt: float | None = None,
        time: ArrayLike | None = None,  # (T,)
        goal: ArrayLike | None = None,  # (D,)
        context: _Context | None = None,  # (Q,)
        names: Sequence[str] | None = None,  # D of them
        units: Sequence[str] | None = None,  # D of them
    ) -> Demonstration: ...
    def __getnewargs_ex__(self) -> tuple[tuple[_Array], dict[str, Any]]: ...
    @property
    def position(self) -> _Array: ...  # (T, D)
    @property
    def time(self) -> _Array | None: ...  # (T,); None while the rate is unknown
    @property
    def dt(self) -> float | None: ...  # None unless given
    @property
    def goal(self) -> _Array | None: ...
    @property
    def context(self) -> _Array | list[float | str] | None: ...
    @property
    def names(self) -> list[str] | None: ...
    @property
    def units(self) -> list[str] | None: ...
    @property
    def n_samples(self) -> int: ...
    @property
    def n_dofs(self) -> int: ...

def fit(
    demos: _Demos,  # M of them, or (M, T, D)
    *,
    kind: _Kind = "discrete",
    dt: float | None = None,
    period: ArrayLike | None = None,  # one, or (M,)
    contexts: _Contexts | None = None,  # (M, Q)
    map: _Map = "auto",
    n_styles: int | Literal["auto"] | None = None,
    spectrum: float | None = None,
    basis: Literal["gp", "ngnet"] | GP | NGnet = "gp",
    smoothing: Literal["auto"] | float | None = "auto",
    nominal: int | None = None,
    n_samples: int | None = None,
    transport: Literal["learnt", "immediate"] = "learnt",
    dof_scale: Literal["unit", "range"] | ArrayLike | None = None,  # (D,)
    alignment: Literal["linear", "warp"] | Warp = "linear",
    events: ArrayLike | None = None,  # (M, E)
    tau: float | None = None,
    alpha_z: float = 25.0,
    beta_z: float | None = None,
    alpha_x: float | None = None,
    mu: float = 1.0,
    threads: int | None = None,
    progress: Callable[[str, float], object] | None = None,  # stage, share in [0, 1]
) -> Model: ...
def inspected(
    demos: Sequence[Demonstration], *, dt: float | None = None
) -> tuple[list[Demonstration], list[str]]: ...
def factorise(
    targets: ArrayLike,  # (M, C*D)
    *,
    n_styles: int | None = None,
    spectrum: float = 0.9,
) -> Factors: ...
def load(path: str | PathLike[str]) -> Model: ...
def resample(demo: Demonstration, dt: float) -> Demonstration: ...
def trim(demo: Demonstration, threshold: float = 0.05) -> Demonstration: ...
def cut(demo: Demonstration, times: ArrayLike) -> list[Demonstration]: ...  # one fewer than times
def lowpass(demo: Demonstration, cut_off: float) -> Demonstration: ...
def residuals(demo: Demonstration, cut_offs: ArrayLike) -> _Array: ...  # (K, D)
def period(demo: Demonstration) -> float: ...
def fill(
    position: ArrayLike,  # (T, D)
    time: ArrayLike,  # (T,)
    names: Sequence[str],  # D of them
    turns: Sequence[float],  # D of them; 0 where no angle
    max_gap: float,
) -> _Array: ...  # (T, D)
def cycles(
    recordings: _Demos,
    events: Sequence[ArrayLike] | None,  # one (K,) for each recording
    average: bool,
) -> tuple[
    list[Demonstration],
    _Array,  # (K,)
    list[list[float]],  # (K, D)
    list[int],
    list[tuple[int, float, float, str, bool]],
    list[tuple[int, int, float, int]],
]: ...

@final
class Model:
    @property
    def kind(self) -> _Kind: ...
    @property
    def n_demos(self) -> int: ...
    @property
    def n_dofs(self) -> int: ...
    @property
    def n_styles(self) -> int: ...
    @property
    def tau(self) -> float: ...
    @property
    def alpha_z(self) -> float: ...
    @property
    def beta_z(self) -> float: ...
    @property
    def alpha_x(self) -> float | None: ...  # None if rhythmic
    @property
    def braking(self) -> float | None: ...  # None if rhythmic or transport is immediate
    @property
    def mu(self) -> float | None: ...  # None if discrete
    @property
    def names(self) -> list[str]: ...
    @property
    def units(self) -> list[str]: ...  # "" where unknown
    @property
    def nominal(self) -> int: ...
    @property
    def styles(self) -> _Array: ...  # (M, J)
    @property
    def singular_values(self) -> _Array: ...  # decreasing: all, or of a large library the first J
    @property
    def left_out(self) -> float: ...  # share of the targets, by RMS, that J styles leave out
    @property
    def noise(self) -> _Array: ...  # (D,), standard deviation
    @property
    def cut_offs(self) -> _Array: ...  # (D,), Hz, inf where nothing is smoothed
    @property
    def dof_scale(self) -> _Array: ...  # (D,)
    @property
    def goals(self) -> _Array: ...  # (M, D)
    @property
    def starts(self) -> _Array: ...  # (M, D)
    @property
    def anchors(self) -> _Array: ...  # (M, D)
    @property
    def breaks(self) -> _Array: ...  # (K+1,), K = 1 where time is scaled linearly
    @property
    def timings(self) -> _Array: ...  # (M, K)
    @property
    def durations(self) -> _Array: ...  # (M,)
    @property
    def contexts(self) -> _Array | list[list[float | str]] | None: ...  # (M, Q)
    @property
    def map(self) -> ContextMap | None: ...
    @property
    def basis(self) -> str: ...  # what was chosen, in one line
    @property
    def table_error(self) -> float: ...  # estimated error of the compiled landscape
    def rollout(
        self,
        style: ArrayLike | None = None,  # (J,)
        *,
        goal: ArrayLike | None = None,  # (D,), as are start, velocity and anchor
        start: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        anchor: ArrayLike | None = None,
        amplitude: float = 1.0,
        tau: float | None = None,
        timing: ArrayLike | None = None,  # (K,), in place of tau
        dt: float = 0.01,
        duration: float | None = None,
        context: _Context | None = None,  # (Q,)
        phase: float | None = None,  # rhythmic
    ) -> Trajectory: ...
    def rollouts(
        self,
        styles: ArrayLike,  # (B, J)
        *,
        goals: ArrayLike | None = None,  # (D,) or (B, D), as are starts, velocities and anchors
        starts: ArrayLike | None = None,
        velocities: ArrayLike | None = None,
        anchors: ArrayLike | None = None,
        amplitude: float = 1.0,
        tau: float | None = None,
        dt: float = 0.01,
        duration: float | None = None,
        derivatives: int = 1,  # at most 2
        out: Sequence[_Array] | None = None,
        threads: int | None = None,
    ) -> tuple[_Array, ...]: ...  # positions and as many derivatives (B, T, D)
    def rollout_chunks(
        self,
        styles: ArrayLike,  # (B, J)
        *,
        size: int = 1000,
        goals: ArrayLike | None = None,  # (D,) or (B, D), as are starts, velocities and anchors
        starts: ArrayLike | None = None,
        velocities: ArrayLike | None = None,
        anchors: ArrayLike | None = None,
        amplitude: float = 1.0,
        tau: float | None = None,
        dt: float = 0.01,
        duration: float | None = None,
        derivatives: int = 1,
        threads: int | None = None,
    ) -> RolloutChunks: ...
    def style_jacobian(
        self,
        dt: float = 0.01,
        *,
        derivative: int = 0,  # at most 2
        start: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        amplitude: float = 1.0,
        tau: float | None = None,
        duration: float | None = None,
    ) -> _Array: ...  # (T, D, J)
    def goal_jacobian(
        self,
        dt: float = 0.01,
        *,
        derivative: int = 0,
        tau: float | None = None,
        duration: float | None = None,
    ) -> _Array: ...  # (T, D, D)
    def anchor_jacobian(
        self,
        dt: float = 0.01,
        *,
        derivative: int = 0,
        start: ArrayLike | None = None,
        tau: float | None = None,
        duration: float | None = None,
    ) -> _Array: ...  # (T, D, D)
    def start_jacobian(
        self,
        dt: float = 0.01,
        *,
        derivative: int = 0,
        tau: float | None = None,
        duration: float | None = None,
    ) -> _Array: ...  # (T, D, D)
    def style_of(
        self,
        demonstration: Demonstration,
        *,
        dt: float | None = None,
        period: float | None = None,
        events: ArrayLike | None = None,  # (E,)
    ) -> _Array: ...  # (J,)
    def landscape(self, u: ArrayLike) -> _Array: ...  # (len(u), J, D)
    def transport(self, u: ArrayLike) -> _Array: ...  # (n,)
    def tau_at(self, phase: float, timing: ArrayLike) -> float: ...  # timing (K,)
    def predict(self, context: _Context) -> Prediction: ...
    def band(
        self,
        context: _Context,  # (Q,)
        *,
        level: float = 0.9,
        dt: float = 0.01,
    ) -> tuple[_Array, _Array]: ...  # lower, upper (T, D)
    def save(self, path: str | PathLike[str]) -> None: ...
    def controller(
        self,
        dt: float = 0.001,
        style: ArrayLike | None = None,
        goal: ArrayLike | None = None,
        start: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        tau: float | None = None,
        transition: float | None = None,
        *,
        anchor: ArrayLike | None = None,
        amplitude: float = 1.0,
        timing: ArrayLike | None = None,  # (K,)
        context: _Context | None = None,
        phase: float | None = None,
    ) -> Controller: ...
    def to_bytes(self) -> bytes: ...
    @staticmethod
    def from_bytes(data: bytes) -> Model: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class RolloutChunks:
    def __iter__(self) -> RolloutChunks: ...
    def __next__(self) -> tuple[_Array, ...]: ...

@final
class Factors:
    @property
    def styles(self) -> _Array: ...  # (M, J)
    @property
    def basis(self) -> _Array: ...  # (J, C*D)
    @property
    def singular_values(self) -> _Array: ...  # decreasing: all, or of a large library the first J
    @property
    def left_out(self) -> float: ...

@final
class Prediction:
    @property
    def style(self) -> _Array: ...  # (J,)
    @property
    def goal(self) -> _Array | None: ...  # (D,); None if rhythmic
    @property
    def start(self) -> _Array | None: ...  # (D,); None if rhythmic
    @property
    def anchor(self) -> _Array | None: ...  # (D,); None if discrete
    @property
    def timing(self) -> _Array: ...  # (K,)
    @property
    def duration(self) -> float: ...  # the sum of the timing
    @property
    def covariance(self) -> _Array | None: ...  # of all of these in this order, (P, P)
    @property
    def freedom(self) -> int: ...  # degrees of freedom from which the covariance is known
    @property
    def outside(self) -> _Array: ...  # (Q,), in ranges of the demonstrated contexts

@final
class ContextMap:
    def __new__(
        cls,
        contexts: _Contexts,  # (M, Q)
        outputs: ArrayLike,  # (M, P)
        map: _Map = "auto",
    ) -> ContextMap: ...
    @property
    def kind(self) -> Literal["stacked", "gp", "linear", "polynomial"]: ...
    @property
    def errors(self) -> list[tuple[str, float]]: ...
    @property
    def freedom(self) -> int: ...
    def predict(self, contexts: _Contexts) -> tuple[_Array, _Array | None]: ...

@final
class Trajectory:
    @property
    def time(self) -> _Array: ...  # (T,)
    @property
    def position(self) -> _Array: ...  # (T, D)
    @property
    def velocity(self) -> _Array: ...  # (T, D)
    @property
    def acceleration(self) -> _Array: ...  # (T, D)
    @property
    def names(self) -> list[str]: ...
    @property
    def units(self) -> list[str]: ...  # "" where unknown
    def to_dict(self) -> dict[str, Any]: ...
    def to_dataframe(self) -> Any: ...  # pandas.DataFrame
    def to_csv(self, path: str | PathLike[str]) -> None: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Status:
    WORKING: ClassVar[Status]
    FINISHED: ClassVar[Status]
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __bool__(self) -> bool: ...
    def __int__(self) -> int: ...

@final
class Controller:
    def __copy__(self) -> Controller: ...
    def __deepcopy__(self, _memo: Any, /) -> Controller: ...
    def step(
        self,
        dt: float | None = None,
        *,
        measured: ArrayLike | None = None,  # (D,)
        coupling: tuple[ArrayLike, ArrayLike] | None = None,  # velocity and acceleration (D,)
    ) -> Status: ...
    def release(self) -> None: ...
    def run(
        self,
        rate_hz: float | None = None,
        *,
        duration: float | None = None,
        measured: Callable[[], ArrayLike | None] | None = None,  # (D,)
        coupling: Callable[[], tuple[ArrayLike, ArrayLike] | None] | None = None,  # both (D,)
        late: Literal["wait", "catch up"] = "wait",
    ) -> Run: ...
    def reset(
        self,
        *,
        style: ArrayLike | None = None,
        goal: ArrayLike | None = None,
        start: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        anchor: ArrayLike | None = None,
        amplitude: float = 1.0,
        tau: float | None = None,
        timing: ArrayLike | None = None,  # (K,)
        context: _Context | None = None,
        phase: float | None = None,
    ) -> None: ...
    @property
    def position(self) -> _Array: ...  # (D,), a read-only view that each step updates
    @property
    def velocity(self) -> _Array: ...
    @property
    def acceleration(self) -> _Array: ...
    @property
    def status(self) -> Status: ...
    @property
    def phase(self) -> float: ...  # x in (0, 1], or phi in [0, 2 pi)
    @property
    def time(self) -> float: ...
    @property
    def goal(self) -> _Array: ...
    @goal.setter
    def goal(self, goal: ArrayLike, /) -> None: ...
    @property
    def style(self) -> _Array: ...
    @style.setter
    def style(self, style: ArrayLike, /) -> None: ...
    @property
    def anchor(self) -> _Array: ...
    @anchor.setter
    def anchor(self, anchor: ArrayLike, /) -> None: ...
    @property
    def tau(self) -> float: ...
    @tau.setter
    def tau(self, tau: float, /) -> None: ...
    @property
    def amplitude(self) -> float: ...
    @amplitude.setter
    def amplitude(self, amplitude: float, /) -> None: ...
    @property
    def speed(self) -> float: ...
    @speed.setter
    def speed(self, speed: float, /) -> None: ...
    @property
    def compliance(self) -> tuple[float, float]: ...  # stopping k_s, tracking k_t
    @compliance.setter
    def compliance(self, compliance: tuple[float, float], /) -> None: ...

@final
class GP:
    def __new__(
        cls,
        kernel: _Kernel = "matern52",
        length: float | None = None,
        noise: float | None = None,
    ) -> GP: ...
    @property
    def kernel(self) -> _Kernel: ...
    @property
    def length(self) -> float | None: ...
    @property
    def noise(self) -> float | None: ...
    def regress(
        self,
        u: ArrayLike,  # (C,)
        targets: ArrayLike,  # (C, P)
        *,
        periodic: bool = False,
    ) -> GPRegression: ...

@final
class GPRegression:
    @property
    def kernel(self) -> _Kernel: ...
    @property
    def length(self) -> float: ...
    @property
    def noise(self) -> float: ...
    @property
    def signal_variance(self) -> float: ...  # in the squared unit of the outputs
    @property
    def log_likelihood(self) -> float: ...  # summed over the outputs
    def predict(self, u: ArrayLike) -> tuple[_Array, _Array]: ...  # mean, variance (len(u), P)

@final
class Warp:
    def __new__(cls, segments: int = 8, slope: float = 2.5) -> Warp: ...
    @property
    def segments(self) -> int: ...
    @property
    def slope(self) -> float: ...
    def __getnewargs__(self) -> tuple[int, float]: ...

@final
class NGnet:
    def __new__(cls, n_basis: int = 50, overlap: float = 1.2) -> NGnet: ...
    @property
    def n_basis(self) -> int: ...
    @property
    def overlap(self) -> float: ...  # in centre spacings
    def regress(
        self,
        u: ArrayLike,  # (C,)
        targets: ArrayLike,  # (C, P)
        *,
        periodic: bool = False,
    ) -> NGnetRegression: ...

@final
class NGnetRegression:
    def predict(self, u: ArrayLike) -> tuple[_Array, None]: ...  # mean (len(u), P), no variance
