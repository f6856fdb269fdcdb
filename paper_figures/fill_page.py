"""The pages that set our numbers beside print, as Markdown with places to fill in."""

from pathlib import Path

FOLDER = Path(__file__).parent / "pages"


def fill_page(name: str, **values: object) -> str:
    """The page `pages/NAME.md` with the values in its places."""
    return (FOLDER / f"{name}.md").read_text(encoding="utf-8").format(**values)
