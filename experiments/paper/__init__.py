"""Reproduces the paper of Östring and Gunnarsson on MuJoCo data.

`evidence` simulates and estimates, `measures` computes numbers from the results, `claims` (with
``claims.toml``) checks the paper's claims with these numbers, `figures` draws, and `reproduce`
writes the page.
"""
