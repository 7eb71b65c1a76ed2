"""The live axis: a simulation session, and its page in the browser.

`session` runs the axis (`axis`) with two estimators (`racer`) and records how they track each
change (`tracking`). `page` draws the session, and `serve` serves the page on this computer only.
`view` draws an axis without a browser. Clicks or a lesson are the inputs; curves and tables are the
outputs.
"""
