"""Compute run scores, theoretical bounds, pooled scores and confidence intervals.

All scores are computed from a `Track`, which contains the estimates and the true values of one run.
The scores of a run form a list with one row per parameter. The module `score_table` defines every
score. The modules `scores`, `excess`, `detection`, `consistency` and `control_benefit` compute the
scores from the samples that the module `windows` selects. The modules `bounds` and `true_model`
compute theoretical bounds. The modules `summary` and `pooling` combine the scores from many seeds,
and the module `intervals` computes confidence intervals.
"""
