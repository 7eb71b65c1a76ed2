"""The paper, reproduced and checked.

`data` simulates, `experiments` and `further_work` estimate, `model_measures` and `filter_measures`
give the numbers, `claims` says what must hold of them, `figures` draws,
`reproduce` does all of it. In come a size and seeds, out go figures, claims kept or not, and a
page.
"""
