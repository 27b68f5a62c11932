// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/features/sift_kernels.h"

#define PLIANT_KERNEL_FILE "descriptor/features/sift_kernels.inl"
#define PLIANT_KERNEL_NAMESPACE pliant::sift
#include "descriptor/base/kernel_sets.inl"
