"""What the library reports while it works: the history, a progress bar, a caller's own function."""

from __future__ import annotations

from typing import Any, Callable, NamedTuple, Optional, Union

import numpy as np
from numpy.typing import NDArray

from ._lib import ArgumentError, text
from ._optional import optional


class Progress(NamedTuple):
    """One report. stage: "solve", or what is made ready for it, as "levels" (step is then 0); step: nonlinear
    iterations from 1; change: relative change of
    mu per unit time, which ends the iteration when it reaches tolerance; gap: of the certificate
    after the step before, NaN if not computed; seconds: since the stage began, of a step since
    the call did."""

    stage: str
    step: int
    max_steps: int
    cg_iterations: int
    change: float
    tolerance: float
    gap: float
    seconds: float


ProgressOption = Union[bool, Callable[[Progress], Any]]

HISTORY = np.dtype(
    [
        ("step", np.int32),
        ("cg_iterations", np.int32),
        ("change", np.float64),
        ("tolerance", np.float64),
        ("gap", np.float64),
        ("seconds", np.float64),
    ]
)


class Watch:
    """Gathers the steps of one solve and hands each report on."""

    def __init__(self, progress: ProgressOption):
        if not (isinstance(progress, bool) or callable(progress)):
            raise ArgumentError(f"progress = {progress!r}: expected True, False or a function")
        self.rows: "list[tuple[Any, ...]]" = []
        self.callback: Optional[Callable[[Progress], Any]] = progress if callable(progress) else None
        self.bar: Any = None
        if progress is True:
            self.bar = optional("tqdm.auto").tqdm(desc="solve", unit=" steps")

    def __call__(self, raw: Any) -> None:
        report = Progress(
            text(raw.stage),
            raw.step,
            raw.max_steps,
            raw.cg_iterations,
            raw.change,
            raw.tolerance,
            raw.gap,
            raw.seconds,
        )
        if report.stage == "solve":
            self.rows.append(
                (
                    report.step,
                    report.cg_iterations,
                    report.change,
                    report.tolerance,
                    report.gap,
                    report.seconds,
                )
            )
        if self.bar is not None and report.stage == "solve":
            self.bar.update(report.step - self.bar.n)
            self.bar.set_postfix_str(f"change {report.change:.1e}, ends at {report.tolerance:.1e}")
        if self.callback is not None:
            self.callback(report)

    def close(self) -> None:
        if self.bar is not None:
            self.bar.close()

    def history(self) -> NDArray[np.void]:
        return np.array(self.rows, HISTORY)
