"""Interactive panels for notebooks; `view` computes, `panel` only shows."""
