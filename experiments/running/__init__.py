"""From a plan to rows: cases on records, many processes, files that survive."""
