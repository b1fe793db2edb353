# Golden numbers of the ordinal mixed model, from R's package ordinal and from lme4. Run in this folder: Rscript clmm.R
suppressMessages({library(ordinal); library(lme4); library(emmeans)})
options(digits = 15)
wine <- get(data(wine, package = "ordinal"))
write.csv(wine[c("rating", "temp", "contact", "judge")], "wine.csv", row.names = FALSE, quote = FALSE)
number <- function(x) paste(format(unname(x), digits = 15, scientific = FALSE, trim = TRUE), collapse = ", ")
one <- function(name, fit) {
  sd <- sqrt(as.numeric(VarCorr(fit)[[1]]))
  fixed <- length(fit$alpha) + length(fit$beta)
  errors <- sqrt(diag(vcov(fit)))[seq_len(fixed)]
  sprintf('  "%s": {\n    "thresholds": [%s],\n    "coefficients": [%s],\n    "sd": %s,\n    "log_likelihood": %s,\n    "standard_errors": [%s]\n  }',
          name, number(fit$alpha), number(fit$beta), number(sd), number(as.numeric(logLik(fit))), number(errors))
}
close <- clmm.control(method = "nlminb", gradTol = 1e-10, maxIter = 500, rel.tol = 1e-14, x.tol = 1e-12)
fit <- function(link, formula, data, nodes = 21)
  clmm(formula, data = data, link = link, nAGQ = nodes, control = close)
set.seed(1)
people <- 40
made <- expand.grid(trial = 1:3, person = seq_len(people))
made$kind <- c("full", "random", "subgoals")[(made$trial + made$person) %% 3 + 1]
made$layout <- c("a", "b", "c")[made$trial]
latent <- rnorm(people, 0, 1.1)[made$person] + 0.7 * (made$kind == "subgoals") - 0.4 * (made$kind == "random") +
  0.3 * (made$layout == "c") + rnorm(nrow(made))
made$rating <- as.integer(cut(latent, c(-Inf, -1.5, -0.5, 0.4, 1.3, Inf)))
made <- made[-c(2, 17, 33, 34, 71), ]
write.csv(made[c("person", "trial", "kind", "layout", "rating")], "ratings.csv", row.names = FALSE, quote = FALSE)
made$rating <- factor(made$rating, ordered = TRUE)
made$person <- factor(made$person)
made$high <- as.integer(as.integer(made$rating) >= 4)
binary <- glmer(high ~ kind + layout + (1 | person), data = made, family = binomial, nAGQ = 21,
                control = glmerControl(optimizer = "bobyqa", optCtrl = list(maxfun = 1e5, rhoend = 1e-9)))
planned <- fit("probit", rating ~ kind + layout + (1 | person), made)
pairs <- summary(contrast(emmeans(planned, "kind"), list(
  "subgoals-random" = c(0, -1, 1), "subgoals-full" = c(-1, 0, 1), "full-random" = c(1, -1, 0))), adjust = "holm")
without <- function(formula) {
  smaller <- fit("probit", formula, made)
  statistic <- 2 * as.numeric(logLik(planned) - logLik(smaller))
  df <- attr(logLik(planned), "df") - attr(logLik(smaller), "df")
  c(statistic, df, pchisq(statistic, df, lower.tail = FALSE))
}
saddle <- read.csv("saddle.csv")
for (name in c("participant", "kind", "layout")) saddle[[name]] <- factor(saddle[[name]])
saddle$rating <- factor(saddle$rating, ordered = TRUE)
parts <- c(
  one("saddle probit", fit("probit", rating ~ kind + layout + (1 | participant), saddle)),
  sprintf('  "contrasts": {\n    "names": ["subgoals-random", "subgoals-full", "full-random"],\n    "estimates": [%s],\n    "standard_errors": [%s],\n    "z": [%s],\n    "holm": [%s]\n  }',
          number(pairs$estimate), number(pairs$SE), number(pairs$z.ratio), number(pairs$p.value)),
  sprintf('  "without kind": [%s]', number(without(rating ~ layout + (1 | person)))),
  sprintf('  "without layout": [%s]', number(without(rating ~ kind + (1 | person)))),
  one("wine logit", fit("logit", rating ~ temp + contact + (1 | judge), wine)),
  one("wine probit", fit("probit", rating ~ temp + contact + (1 | judge), wine)),
  one("ratings logit", fit("logit", rating ~ kind + layout + (1 | person), made)),
  one("ratings probit", fit("probit", rating ~ kind + layout + (1 | person), made)),
  one("ratings probit null", fit("probit", rating ~ layout + (1 | person), made)),
  sprintf('  "binary logit": {\n    "thresholds": [%s],\n    "coefficients": [%s],\n    "sd": %s,\n    "log_likelihood": %s,\n    "standard_errors": [%s]\n  }',
          number(-fixef(binary)[1]), number(fixef(binary)[-1]), number(sqrt(as.numeric(VarCorr(binary)[[1]]))),
          number(as.numeric(logLik(binary))), number(sqrt(diag(as.matrix(vcov(binary)))))),
  sprintf('  "versions": "R %s, ordinal %s, lme4 %s, emmeans %s"', getRversion(), packageVersion("ordinal"),
          packageVersion("lme4"), packageVersion("emmeans"))
)
writeLines(c("{", paste(parts, collapse = ",\n"), "}"), "clmm.json")
