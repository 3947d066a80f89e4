"""Help texts on narrow terminals: a word longer than its column goes on in the next line; Typer would cut it off."""

from __future__ import annotations

import typer
from typer.core import TyperCommand


class HelpfulCommand(TyperCommand):
    """A command whose help is shown in full at any width."""

    def format_help(self, ctx: typer.Context, formatter: typer.core.click.HelpFormatter) -> None:  # type: ignore
        from rich.columns import Columns
        from rich.table import Table
        from rich.text import Text
        from typer import rich_utils

        class FoldingTable(Table):
            def add_row(self, *cells: object, **style: object) -> None:
                super().add_row(*cells, **style)  # type: ignore[arg-type]
                for column in self.columns:
                    column.overflow = "fold"

        class FoldingColumns(Columns):
            def __init__(self, parts: list[object]) -> None:
                super().__init__(parts)  # type: ignore[arg-type]
                for part in parts:
                    if isinstance(part, Text):
                        part.overflow = "fold"

        rich_utils.Table, rich_utils.Columns = FoldingTable, FoldingColumns  # type: ignore # Typer has no option for it
        try:
            super().format_help(ctx, formatter)
        finally:
            rich_utils.Table, rich_utils.Columns = Table, Columns  # type: ignore
