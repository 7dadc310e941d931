"""Force controllers of the literature, behind the same interface as the adaptive one."""
