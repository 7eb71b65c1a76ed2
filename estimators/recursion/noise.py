"""The running estimate of the noise variance that turns P into a claimed covariance."""

from dataclasses import dataclass


@dataclass
class NoiseVariance:
    """
    Mean of ε²/(1+ψᵀPψ), exponential with a memory, exact before that.

    Attributes
    ----------
    memory : float
        In samples.
    given : float
        The variance, if it is known; else 0.
    """

    memory: float
    given: float = 0.0
    value: float = 1.0  # the paper's unit, until something is measured
    count: float = 0.0

    def __post_init__(self) -> None:
        self.value = self.given or self.value

    def add(self, sample: float) -> None:
        """Take one squared residual, divided by what the uncertainty of θ̂ adds to it."""
        self.count = min(self.count + 1, self.memory)
        if not self.given:
            self.value += (sample - self.value) / self.count
