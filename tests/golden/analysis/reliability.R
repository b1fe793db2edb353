# Makes reliability.csv and reliability.json: Cronbach's alpha with Feldt's interval by formula, omega from factanal.
# Run in this folder: Rscript reliability.R
suppressPackageStartupMessages(library(jsonlite))
set.seed(2021, kind = "Mersenne-Twister", normal.kind = "Inversion", sample.kind = "Rejection")
factor <- rnorm(120)
items <- sapply(c(.9, .8, .7, .9, .6, .5, .8, .7, .4), function(loading) pmin(5, pmax(1, round(3 + loading * factor + rnorm(120, sd = .8)))))
colnames(items) <- paste0("satisfaction_", 1:9)
write.csv(items, "reliability.csv", row.names = FALSE, quote = FALSE)
items <- as.matrix(read.csv("reliability.csv"))
n <- nrow(items); k <- ncol(items)
alpha <- k / (k - 1) * (1 - sum(apply(items, 2, var)) / var(rowSums(items)))
fit <- factanal(items, 1, control = list(opt = list(factr = 10, maxit = 10000)))
loadings <- as.numeric(fit$loadings); sds <- apply(items, 2, sd)
common <- sum(loadings * sds)^2
write_json(list(
  versions = list(R = R.version.string),
  alpha = alpha, low = 1 - (1 - alpha) * qf(.975, n - 1, (n - 1) * (k - 1)), high = 1 - (1 - alpha) * qf(.025, n - 1, (n - 1) * (k - 1)),
  mean_correlation = mean(cor(items)[upper.tri(diag(k))]),
  omega = common / (common + sum(fit$uniquenesses * sds^2)), loadings = loadings * sign(sum(loadings))),
  "reliability.json", digits = I(15), auto_unbox = TRUE, pretty = TRUE)
