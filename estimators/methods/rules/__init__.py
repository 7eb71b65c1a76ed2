"""
Rules of forgetting that take the place of eq. (9) and (10): what to forget, how much, and when.

One module a rule: equation, source, and the compiled function that
`flexaxis.estimators.recursion.updates` calls after each measurement, with ψᵀPψ (``scale``) and the
noise variance (``quiet``) from before.
"""
