"""Reproduce the results of Östring and Gunnarsson's paper with data from MuJoCo.

The module `evidence` simulates the experiments and estimates the parameters. The module `measures`
computes a numerical measure for each claim from the estimates. The module `claims` and the file
``claims.toml`` use these measures to check the claims of the paper. The module `figures` draws the
figures of the paper, and the module `reproduce` writes a web page with the results.
"""
