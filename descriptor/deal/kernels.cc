// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/deal/kernels.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

#define PLIANT_KERNEL_FILE "descriptor/deal/kernels.inl"
#define PLIANT_KERNEL_NAMESPACE pliant::deal
#include "descriptor/base/kernel_sets.inl"
