"""The live demo shows a simulated axis and two estimators on a web page.

The module `axis` simulates the axis, and `racer` runs an estimator on the measured signals. The
module `tracking` records how the estimators track each parameter change. The module `session`
combines the modules `axis`, `racer` and `tracking`. The module `page` draws the web page, and
`serve` starts a server for this page. Only browsers on the same computer can open the page. A user
controls the demo with clicks or with a lesson file, which contains timed actions. The module `view`
draws an axis without a browser.
"""
