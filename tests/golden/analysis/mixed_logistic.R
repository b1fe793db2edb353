# Makes mixed_logistic.csv and mixed_logistic.json: a logistic model with a random intercept by lme4::glmer.
# Run in this folder: Rscript mixed_logistic.R
suppressPackageStartupMessages({library(lme4); library(jsonlite)})
set.seed(2021, kind = "Mersenne-Twister", normal.kind = "Inversion", sample.kind = "Rejection")
people <- rep(1:80, each = 3)
kinds <- c("full", "none", "subgoals")
kind <- unlist(lapply(1:80, function(i) kinds[(0:2 + i) %% 3 + 1]))
layout <- unlist(lapply(1:80, function(i) c("a", "b", "c")[(0:2 + i %/% 3) %% 3 + 1]))
chance <- plogis(.3 + .9 * (kind == "subgoals") - .5 * (kind == "none") + .4 * (layout == "b") + rep(rnorm(80, sd = 1.2), each = 3))
data <- data.frame(participant = sprintf("p%02d", people), kind, layout, trial = rep(1:3, 80), right = as.integer(runif(240) < chance))
write.csv(data, "mixed_logistic.csv", row.names = FALSE, quote = FALSE)
data <- read.csv("mixed_logistic.csv")
fit <- glmer(right ~ kind + layout + factor(trial) + (1 | participant), data, family = binomial, nAGQ = 25,
             control = glmerControl(optimizer = "bobyqa", optCtrl = list(maxfun = 1e6), tolPwrss = 1e-12))
b <- fixef(fit); sd <- unname(attr(VarCorr(fit)$participant, "stddev"))
# glmer's covariance of fixed effects holds the sd fixed unless it uses the Hessian, which it does here.
v <- as.matrix(vcov(fit, use.hessian = TRUE))
contrast <- c(0, -1, 1, 0, 0, 0, 0)
# The probability of a kind, averaged over all rows and persons, by numerical integration.
average <- function(kind) {
  x <- model.matrix(~ kind + layout + factor(trial), transform(data, kind = factor(kind, levels = kinds)))
  x[, 2:3] <- rep(c(kind == "none", kind == "subgoals"), each = nrow(x))
  mean(sapply(as.numeric(x %*% b), function(eta) integrate(function(u) plogis(eta + u) * dnorm(u, sd = sd), -12 * sd, 12 * sd, rel.tol = 1e-10)$value))
}
write_json(list(
  versions = list(R = R.version.string, lme4 = as.character(packageVersion("lme4"))),
  coefficients = unname(b), standard_errors = unname(sqrt(diag(v))), sd = sd, log_likelihood = as.numeric(logLik(fit)),
  subgoals_none = list(log_odds = sum(contrast * b), error = sqrt(drop(contrast %*% v %*% contrast))),
  average = sapply(kinds, average)),
  "mixed_logistic.json", digits = I(12), auto_unbox = TRUE, pretty = TRUE)
