"""The charts of the pages of logs and of the demo; everything else draws with matplotlib figures.

In come charts as data (`charts`), out go SVG (`drawing`) and pages (`page`).
"""
