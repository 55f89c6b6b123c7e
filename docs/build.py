"""Build the documentation, offline: pages from the code, figures from scripts, then Sphinx.

    python docs/build.py            # into docs/_build/html; warnings are errors

Only the gallery fits models. Run docs/models/fits.py to update the examples on the models' pages, and
docs/tour.py to update the screenshots of the workbench.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import warnings
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from making.api import write_api
from making.commands import write_commands
from making.gallery import write_gallery
from making.glossary import write_glossary
from making.models import write_models
from making.options import write_options
from making.pages import DOCS, MADE


def build(into: Path, jobs: int) -> int:
    """Run Sphinx over all pages; every warning is an error."""
    from sphinx.cmd.build import build_main

    # -a writes all pages: the search index contains only pages that are written
    options = ["-W", "-a", "--keep-going", "-q", "-j", str(jobs), "-b", "html"]
    return build_main([*options, "-d", str(into.with_name("doctrees")), str(DOCS), str(into)])


def main() -> int:
    """Build everything."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--clean", action="store_true", help="delete what earlier builds made")
    parser.add_argument(
        "--into", type=Path, default=DOCS / "_build" / "html", help="folder to build into"
    )
    parser.add_argument("--jobs", type=int, default=2, help="processes of Sphinx")
    given = parser.parse_args()
    if given.clean:
        shutil.rmtree(MADE, ignore_errors=True)
        shutil.rmtree(DOCS / "_build", ignore_errors=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        write_api()
        write_commands()
        write_options()
        write_glossary()
        with ProcessPoolExecutor(
            1
        ) as pool:  # the gallery's fits, in parallel with the models' pages
            gallery = pool.submit(write_gallery)
            write_models()
            gallery.result()
    code = build(given.into, given.jobs)
    print(f"Built: {given.into / 'index.html'}" if code == 0 else "Sphinx reported warnings.")
    return code


if __name__ == "__main__":
    sys.exit(main())
