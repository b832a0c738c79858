"""A workbench in the browser: what `speak` does, seen and changed phone by phone. No algorithm is here."""
