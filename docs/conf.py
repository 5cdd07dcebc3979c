"""The site: `python -m sphinx -c docs . site` makes HTML pages in site/ that are read offline, from site/index.html.

The project's folder is the source, so that pages in docs/ and those beside it (README.md, CONTRIBUTING.md) refer to one
another, and to scenarios and programs, by the same relative links as on a code host.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "extensions"))

project = "cardiac-cosim"
copyright = "the cardiac-cosim authors; BSD-3-Clause"

extensions = ["myst_nb", "sphinx_external_toc", "mathml"]

# --- what is a page ---------------------------------------------------------------------------------------------------

root_doc = "docs/index"
include_patterns = ["*.md", "docs/**.md", "docs/**.ipynb"]
# Folders that hold no page are not looked through.
exclude_patterns = [
    *[".*", "site", "jupyter_execute", "results", "build", "dist", "fmus-built"],
    *["benchmarks", "cli", "fmus", "orchestrator", "report", "scenarios", "studies", "tests", "typings", "units"],
]
external_toc_path = "docs/navigation.yml"

# --- Markdown ---------------------------------------------------------------------------------------------------------

myst_enable_extensions = ["dollarmath"]
# Anchors as code hosts make them; a link to one that is not there is a warning, and ends the build of the test.
myst_heading_anchors = 4
myst_url_schemes = ["http", "https", "mailto"]

# --- notebooks --------------------------------------------------------------------------------------------------------

# They are kept without outputs, and executed when the site is built; one that fails ends the build.
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_merge_streams = True

# --- HTML -------------------------------------------------------------------------------------------------------------

html_theme = "furo"
html_title = "cardiac-cosim"
html_extra_path = ["entry"]
html_static_path = ["static"]
html_css_files = ["site.css"]
html_math_renderer = "mathml"
html_show_sphinx = False
# Excerpts in the search would be fetched, which browsers do not do from files.
html_show_search_summary = False
html_copy_source = False
html_show_sourcelink = False
