"""How a model is taken along a stretch of data: all that `relocate` asks of one, by two names."""

from flexaxis.estimators.sampling.sampled import move, sample

prepare = sample
"""``prepare(terms, theta, active)``: what `travel` needs at θ, with derivatives by active ones."""

travel = move
"""``travel(prepared, X, moved, u)`` takes states and sensitivities (rows, n+1) over one sample."""
