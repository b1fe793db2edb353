# Makes pwr.json: the power of two-sided t tests in R.
# Run in this folder: Rscript pwr.R
suppressPackageStartupMessages({library(pwr); library(jsonlite)})

tests <- expand.grid(n = c(5, 10, 20, 60, 120, 400), d = c(0.1, 0.3, 0.5, 0.8, 1.2), level = c(0.05, 0.05 / 9))
tests$paired <- mapply(
  function(n, d, level) pwr.t.test(n = n, d = d, sig.level = level, type = "paired", alternative = "two.sided")$power,
  tests$n, tests$d, tests$level)

versions <- list(R = R.version.string, pwr = as.character(packageVersion("pwr")))
write_json(list(versions = versions, t_tests = tests), "pwr.json", digits = I(15), auto_unbox = TRUE, pretty = TRUE)
