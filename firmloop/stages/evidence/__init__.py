"""Evidence: what a project requires, who has judged it, and with what result; to be filed, and compared later."""
