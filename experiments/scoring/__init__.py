"""Scores of a case, theoretical bounds, pooling over seeds, and intervals.

`score_table` lists every score once. `scores`, `excess`, `detection`, `consistency` and `recovered`
compute them in the `windows` of a case. `bounds` and `true_model` hold the theory. `summary` and
`pooling` combine many seeds into one row, and `intervals` gives its uncertainty. The input is a
Track (estimates and true values), the output are rows.
"""
