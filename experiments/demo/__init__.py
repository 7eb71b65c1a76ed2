"""The live axis: a simulation session, and its page in the browser.

`session` simulates the axis (`axis`), runs two estimators on its data (`racer`), and records how
the estimators track each change (`tracking`). `page` draws the session, and `serve` makes the page
available on this computer only. Clicks, or a lesson file with timed actions, control a session.
`view` draws an axis without a browser.
"""
