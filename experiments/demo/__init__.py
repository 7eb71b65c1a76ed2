"""The live axis: a session without a screen, and a page in the browser.

`session` has the axis (`axis`) and two estimators (`racer`), and follows how they find a change
(`tracking`); `page` shows it, `serve` says who may see it. `view` draws an axis without a browser.
In come clicks or a lesson, out go curves and a table.
"""
