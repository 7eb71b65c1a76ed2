"""What a score is: scores of a case, theory beside them, pooling, intervals.

`score_table` has every score once; `scores`, `excess`, `detection`, `consistency` and `recovered`
compute them in the `windows` of a case in which it is not lost, `bounds` and `true_model` are
the theory, `summary` and `pooling` make one row of many seeds, `intervals` says how sure it is. In
come estimates and the truth (a Track), out go rows.
"""
