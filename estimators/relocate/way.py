"""How a model is taken along a stretch of data: all that `relocate` asks of one, by two names."""

from flexaxis.estimators.sampling.sampled import prepare, travel

__all__ = ["prepare", "travel"]
