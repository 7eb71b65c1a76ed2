"""The report of a study.

`rows` says what is told apart and pools it, `charts` draws scores over the axes, `words` names the
axes, `page` puts them together. In come the results of a study, out goes one HTML file.
"""
