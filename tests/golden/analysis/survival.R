# Makes survival.csv and survival.json: a stratified Cox model with Efron's ties and errors clustered by person.
# Run in this folder: Rscript survival.R
library(survival)
set.seed(7, kind = "Mersenne-Twister", normal.kind = "Inversion", sample.kind = "Rejection")
people <- rep(1:40, each = 3)
kind <- rep(c("a", "b", "c", "b", "c", "a", "c", "a", "b", "a", "c", "b"), 10)
layout <- rep(1:3, 40)
position <- (rep(0:2, 40) + people) %% 3
frailty <- rep(exp(rnorm(40, sd = .5)), each = 3)
steps <- 1 + floor(rexp(120, frailty * exp(.7 * (kind == "b") + .2 * position)) * 4) / 6
arrived <- as.integer(steps <= 2.5)
data <- data.frame(person = people, kind, layout, position, time = pmin(steps, 2.5), arrived)
write.csv(data, "survival.csv", row.names = FALSE, quote = FALSE)
data <- read.csv("survival.csv")
data$b <- as.integer(data$kind == "b")
data$c <- as.integer(data$kind == "c")
fit <- coxph(Surv(time, arrived) ~ b + c + position + strata(layout), data, cluster = person, ties = "efron",
             control = coxph.control(eps = 1e-12, toler.chol = 1e-13, iter.max = 100))
curve <- summary(survfit(Surv(time, arrived) ~ 1, data[data$kind == "a", ]))
# Grambsch and Therneau 1994, with the average covariance, for b and c; R's cox.zph now uses another form of it.
residuals <- residuals(fit, "schoenfeld")
times <- as.numeric(rownames(residuals))
g <- rank(times) - mean(rank(times))
trend <- fit$naive.var %*% colSums(g * residuals)
statistic <- nrow(residuals) / sum(g^2) * t(trend[1:2]) %*% solve(fit$naive.var[1:2, 1:2]) %*% trend[1:2]
numbers <- function(x) paste0("[", paste(sprintf("%.12g", x), collapse = ", "), "]")
writeLines(c("{",
  sprintf('  "coefficients": %s,', numbers(coef(fit))),
  sprintf('  "robust_errors": %s,', numbers(sqrt(diag(fit$var)))),
  sprintf('  "naive_errors": %s,', numbers(sqrt(diag(fit$naive.var)))),
  sprintf('  "log_likelihood": %.12g,', fit$loglik[2]),
  sprintf('  "curve_times": %s,', numbers(curve$time)),
  sprintf('  "curve_arrived": %s,', numbers(1 - curve$surv)),
  sprintf('  "proportionality": %.12g,', statistic),
  sprintf('  "schoenfeld_sums_of_squares": %s', numbers(colSums(residuals^2))), "}"), "survival.json")
