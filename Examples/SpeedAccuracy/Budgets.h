#pragma once

#include "Figures.h"

namespace palpate::accuracy {

/// The columns of measureBudgets().
report::Figures emptyBudgetFigures();

/// Detects the contacts of the organs within budgets, with and without a priority of the first
/// pair, and counts contacts that are missing because a pair was not finished.
void measureBudgets(int frames, report::Figures&);

}  // namespace palpate::accuracy
