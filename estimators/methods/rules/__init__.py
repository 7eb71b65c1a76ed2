"""
Rules of forgetting that take the place of eq. (9) and (10): what to forget, how much, and when.

One module a rule: equation, source, the compiled function that
`flexaxis.estimators.methods.loops` calls after each measurement and in each gap, and the entry
under which it is registered. In come the gradient ψ, P and the residual of a sample, out
goes P.
"""
