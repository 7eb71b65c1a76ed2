"""The running estimate of the noise variance that turns P into a claimed covariance."""

from dataclasses import dataclass

MEMORY = 400  # samples; the relative standard deviation of R̂ is √(2/(2·400)) = 5 %


@dataclass
class NoiseVariance:
    """Mean of ε²/(1+ψᵀPψ), exponential with a memory of `MEMORY` samples, exact before that."""

    value: float = 1.0  # the paper's unit, until something is measured
    count: float = 0.0

    def add(self, sample: float) -> None:
        """Take one squared residual, divided by what the uncertainty of θ̂ adds to it."""
        self.count = min(self.count + 1, MEMORY)
        self.value += (sample - self.value) / self.count
