"""What a page says, without its markup."""

import re


def text_of(html):
    """The text of a page, with f_m for what is typeset."""
    plain = re.sub(r"<i>(.)</i><sub>(\w+)</sub>", r"\1_\2", html)
    return re.sub("<[^>]+>", "", plain)
