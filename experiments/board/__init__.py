"""A board that anyone can join: entries, what is checked of them, and a site of who is ahead."""
