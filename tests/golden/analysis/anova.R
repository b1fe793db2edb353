# Makes anova.csv and anova.json: analysis of variance, cell contrasts, t tests, correlations and tests of variances in R.
# Run in this folder: Rscript anova.R
suppressPackageStartupMessages({library(car); library(emmeans)})

# Ratings of two data sets. In `mild` the cells hold 9 to 25 ratings, in `strong` 3 to 40.
set.seed(2021, kind = "Mersenne-Twister", normal.kind = "Inversion", sample.kind = "Rejection")
rated <- function(name, sizes, means) {
  rows <- lapply(seq_along(sizes), function(cell) data.frame(
    data = name, likeliness = (cell - 1) %/% 2, loveliness = (cell - 1) %% 2,
    general = pmin(5, pmax(1, round(rnorm(sizes[cell], means[cell], 1.1))))))
  all <- do.call(rbind, rows)
  all$person <- paste0("p", (seq_len(nrow(all)) - 1) %% ceiling(nrow(all) / 3))
  all
}
data <- rbind(rated("mild", c(25, 17, 9, 22), c(2.2, 2.0, 3.2, 4.1)), rated("strong", c(40, 3, 5, 12), c(2, 3, 3, 3)))
write.csv(data, "anova.csv", row.names = FALSE, quote = FALSE)

rows_of <- function(table) {
  kept <- table[!rownames(table) %in% c("(Intercept)", "Residuals"), ]
  squares <- if ("Sum Sq" %in% names(kept)) kept[["Sum Sq"]] else kept[["SS"]]
  list(sum_sq = squares, f = kept[["F value"]], p = kept[["Pr(>F)"]])
}

numbers <- function(name) {
  own <- data[data$data == name, ]
  own$a <- factor(own$likeliness); own$b <- factor(own$loveliness)
  model <- lm(general ~ a * b, own, contrasts = list(a = contr.sum, b = contr.sum))
  cells <- summary(contrast(emmeans(model, ~ b | a), list(high_low = c(-1, 1))), infer = TRUE)
  means <- summary(emmeans(model, ~ a * b))
  tests <- lapply(0:1, function(level) {
    high <- own$general[own$likeliness == level & own$loveliness == 1]
    low <- own$general[own$likeliness == level & own$loveliness == 0]
    both <- t.test(high, low, var.equal = TRUE)
    list(t = unname(both$statistic), df = unname(both$parameter), p_two_sided = both$p.value,
         p_high_larger = t.test(high, low, var.equal = TRUE, alternative = "greater")$p.value,
         p_low_larger = t.test(high, low, var.equal = TRUE, alternative = "less")$p.value,
         low = both$conf.int[1], high = both$conf.int[2])
  })
  first <- own$general[own$likeliness == 0]; second <- own$general[own$likeliness == 1]
  ratio <- var.test(first, second)
  brown <- leveneTest(general ~ a, own, center = median)
  # Any two variables that correlate will do.
  x <- own$general + own$likeliness; y <- own$general - 2 * own$loveliness
  correlated <- cor.test(x, y)
  size <- min(length(first), length(second)); pairs_a <- first[1:size]; pairs_b <- second[1:size]
  morgan <- cor.test(pairs_a + pairs_b, pairs_a - pairs_b)
  one <- t.test(own$general)
  person <- factor(own$person)
  within <- anova(lm(x ~ person + y))
  between <- anova(lm(general ~ person, own))
  list(
    types = list(I = rows_of(as.data.frame(anova(model))), II = rows_of(as.data.frame(Anova(model, type = 2))),
                 III = rows_of(as.data.frame(Anova(model, type = 3)))),
    residual = sum(residuals(model)^2), df = df.residual(model),
    cell_means = means$emmean,
    cell_contrasts = list(estimate = cells$estimate, t = cells$t.ratio, p = cells$p.value, low = cells$lower.CL,
                          high = cells$upper.CL, df = cells$df),
    t_tests = tests,
    mean = list(mean = unname(one$estimate), low = one$conf.int[1], high = one$conf.int[2], sd = sd(own$general)),
    correlation = list(r = unname(correlated$estimate), low = correlated$conf.int[1], high = correlated$conf.int[2],
                       p = correlated$p.value, t = unname(correlated$statistic)),
    # The square of a correlation within persons is the slope's share of what people leave (Bakdash and Marusich 2017).
    within = list(r_squared = within["y", "Sum Sq"] / (within["y", "Sum Sq"] + within["Residuals", "Sum Sq"]),
                  df = within["Residuals", "Df"], p = within["y", "Pr(>F)"]),
    between = list(f = between["person", "F value"], p = between["person", "Pr(>F)"], df = between$Df),
    variances = list(ratio = unname(ratio$estimate), low = ratio$conf.int[1], high = ratio$conf.int[2],
                     p = ratio$p.value),
    brown_forsythe = list(f = brown[1, "F value"], p = brown[1, "Pr(>F)"]),
    pitman_morgan = list(t = unname(morgan$statistic), p = morgan$p.value),
    shapiro = list(w = unname(shapiro.test(residuals(model))$statistic), p = shapiro.test(residuals(model))$p.value))
}

written <- function(value, indent = "") {
  if (is.list(value)) {
    inner <- paste0(indent, "  ")
    named <- !is.null(names(value))
    parts <- vapply(seq_along(value), function(place) paste0(
      inner, if (named) sprintf('"%s": ', names(value)[place]), written(value[[place]], inner)), "")
    ends <- if (named) c("{", "}") else c("[", "]")
    return(paste0(ends[1], "\n", paste(parts, collapse = ",\n"), "\n", indent, ends[2]))
  }
  cells <- if (is.character(value)) sprintf('"%s"', value) else vapply(value, format, "", digits = 15)
  if (length(cells) == 1) cells else paste0("[", paste(cells, collapse = ", "), "]")
}

versions <- sprintf("R %s, car %s, emmeans %s", getRversion(), packageVersion("car"), packageVersion("emmeans"))
writeLines(written(list(versions = versions, mild = numbers("mild"), strong = numbers("strong"))), "anova.json")
