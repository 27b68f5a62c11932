// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Of a build without PLIANT_CLICKHOUSE: a cluster's URL is refused with a sentence.
#include "index/store/cluster_scheme.h"

namespace pliant {

void UseClusters() {}

}  // namespace pliant
