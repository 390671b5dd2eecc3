"""The paper's network over a prior. `residuals/`, `fit` and `rows` train it with torch; the others answer without."""
