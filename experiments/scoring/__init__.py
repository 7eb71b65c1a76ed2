"""Scores of a case, theoretical bounds, pooling over seeds, and intervals.

`score_table` lists every score once. `scores`, `excess`, `detection`, `consistency` and `recovered`
compute them in the `windows` of a case. `bounds` and `true_model` contain the theory. `summary` and
`pooling` combine many seeds into one row, and `intervals` computes its uncertainty. The input is a
Track (estimates and true values); the output is a list of rows.
"""
