"""From a plan to rows: cases on records, many processes, shares and what is merged of them."""
