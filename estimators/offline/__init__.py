"""What looks at a whole record: identification, frequency responses, priors, theory.

`identification` fits a model (`trajectory`, `descent`, `prediction_error`), `inverse` and
`frequency` look without one; `structure`, `roles` and `sizes` say what an axis may have and what
of it is known; `priors` and `adaptation` give P(0), Δ and what to expect of them. In come u, y and
a model, out go parameters with their covariance, or numbers to start a filter from.
"""
