# Makes paired.csv and paired.json: signed-rank, rank-sum and t tests, standardized differences, and TOST by two t tests.
# Run in this folder: Rscript paired.R
suppressPackageStartupMessages(library(jsonlite))
set.seed(2021, kind = "Mersenne-Twister", normal.kind = "Inversion", sample.kind = "Rejection")
own <- rnorm(40, sd = .7)
data <- data.frame(first = pmin(5, pmax(1, round(3.4 + own + rnorm(40)))), second = pmin(5, pmax(1, round(3 + own + rnorm(40)))),
                   exact_first = round(3.4 + own + rnorm(40), 6), exact_second = round(3 + own + rnorm(40), 6))
write.csv(data, "paired.csv", row.names = FALSE, quote = FALSE)
data <- read.csv("paired.csv")

differences <- data$first - data$second
kept <- differences[differences != 0]
normal <- wilcox.test(kept, exact = FALSE, correct = FALSE)
few <- data$exact_first[1:20] - data$exact_second[1:20]
exact <- wilcox.test(few, exact = TRUE)
sums <- wilcox.test(data$first[1:20], data$second[21:40], exact = FALSE, correct = FALSE)
sums_exact <- wilcox.test(data$exact_first[1:7], data$exact_second[8:20], exact = TRUE)
t <- t.test(data$first, data$second, paired = TRUE)
df <- unname(t$parameter)
end <- function(share) uniroot(function(nc) pt(t$statistic, df, nc) - share, t$statistic + c(-4, 4), tol = 1e-12)$root / sqrt(df + 1)
lower <- t.test(differences, mu = -.5, alternative = "greater")
upper <- t.test(differences, mu = .5, alternative = "less")
interval <- t.test(differences, conf.level = .9)$conf.int
# Bonett 2008, equation for a paired design with the average variance.
v <- c(var(data$first), var(data$second)); r <- cor(data$first, data$second); s2 <- mean(v)
d_av <- mean(differences) / sqrt(s2)
se <- sqrt(d_av^2 * (v[1]^2 + v[2]^2 + 2 * r^2 * v[1] * v[2]) / (8 * s2^2 * df) + sum(v) / (s2 * df) - 2 * r * sqrt(prod(v)) / (s2 * df))
write_json(list(
  versions = list(R = R.version.string),
  signed_rank = list(normal_v = unname(normal$statistic), normal_p = normal$p.value, exact_v = unname(exact$statistic),
                     exact_p = exact$p.value),
  rank_sum = list(u = unname(sums$statistic), p = sums$p.value, exact_u = unname(sums_exact$statistic),
                  exact_p = sums_exact$p.value),
  t = list(mean = unname(t$estimate), t = unname(t$statistic), df = df, p = t$p.value, low = t$conf.int[1], high = t$conf.int[2]),
  d_z = list(value = unname(t$statistic) / sqrt(df + 1), low = end(.975), high = end(.025)),
  d_av = list(value = d_av, low = d_av - qnorm(.975) * se, high = d_av + qnorm(.975) * se),
  tost = list(t_lower = unname(lower$statistic), p_lower = lower$p.value, t_upper = unname(upper$statistic),
              p_upper = upper$p.value, low = interval[1], high = interval[2])),
  "paired.json", digits = I(15), auto_unbox = TRUE, pretty = TRUE)
