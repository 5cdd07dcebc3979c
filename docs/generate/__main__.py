"""`python docs/generate` writes the pages that derive from the code; a test says when one of them is out of date."""

import command_reference
import decision_index
import fmu_variables
import scenario_keys
import study_keys
import unit_tables

#: Every one has a `PAGE`, the file, and `page()`, its text.
PAGES = (command_reference, decision_index, fmu_variables, scenario_keys, study_keys, unit_tables)

if __name__ == "__main__":
    for module in PAGES:
        module.PAGE.write_text(module.page(), encoding="utf-8")
        print(module.PAGE)
