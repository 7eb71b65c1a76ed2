"""A board that anyone can join: entries, what is checked of them, and a site of who is ahead.

`submission` makes an entry, `entry` reads one; `verification` reruns its rows, and its code on
`hidden_seeds` in a `sandbox` that it talks to by `protocol`; `ranking` and `site` show them. In
come folders with rows and code of strangers, out go verifications and static pages.
"""
