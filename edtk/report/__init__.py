"""Everything that a person reads: text, HTML, Markdown, figures, number formats."""
