// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Why an image is a hit, or was not confirmed as one: what verification saw.
#pragma once

#include <vector>

#include "descriptor/features/features.h"
#include "index/records/explanation.h"
#include "index/verify/verification.h"

namespace pliant {

// Of the first instance, or why there is none.
Explanation Explain(const Features& query, const Features& reference,
                    const VerificationResult& result);

// Of each instance; of none, that one.
std::vector<Explanation> ExplainInstances(const Features& query, const Features& reference,
                                          const VerificationResult& result);

}  // namespace pliant
