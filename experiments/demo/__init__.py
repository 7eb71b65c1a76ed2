"""The live axis: a session without a screen, a page in the browser, a recorder for lectures.

`session` has the axis (`live_axis`), two estimators (`racer`) and how they follow a change
(`tracking`, `history`); `page`, `knobs`, `curves` and `view` show it, `door`, `token` and
`input_check` stand before it, `lesson` and `movie` need no hands. In come clicks or a lesson's
acts, out go pictures and the table of what was done.
"""
