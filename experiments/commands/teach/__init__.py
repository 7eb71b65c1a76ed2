"""Commands to teach with: the live axis, and the paper with its figures and claims.

In come a few options; out come a page in the browser or a film, figures and a page of claims.
"""
