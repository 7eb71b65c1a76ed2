"""Compute scores of a case, theoretical bounds, pooled scores and intervals.

The input is a `Track` with estimates and true values. The output is a list of rows. The module
`score_table` defines every score. The modules `scores`, `excess`, `detection`, `consistency` and
`recovered` compute the scores in the `windows` of a case. The modules `bounds` and `true_model`
compute theoretical bounds. The modules `summary` and `pooling` combine the rows of many seeds into
one row, and the module `intervals` computes confidence intervals.
"""
