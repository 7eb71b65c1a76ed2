"""The paper of Östring and Gunnarsson, reproduced on MuJoCo data.

`evidence` simulates and estimates, `measures` makes numbers of it, `claims` (with ``claims.toml``)
decides by them what the paper claims, `figures` draws, and `reproduce` writes it all.
"""
