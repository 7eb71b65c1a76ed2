"""Reproduce the paper of Östring and Gunnarsson with data from MuJoCo.

`evidence` simulates the experiments and estimates the parameters, `measures` computes numbers from
the estimates, and `claims` (with ``claims.toml``) uses these numbers to check the paper's claims.
`figures` draws the figures, and `reproduce` writes the page.
"""
