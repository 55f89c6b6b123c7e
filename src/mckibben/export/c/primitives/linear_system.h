/* A small linear system, solved in place by elimination with pivots: the solution replaces `right`. */
#ifndef MCK_LINEAR_SYSTEM_H
#define MCK_LINEAR_SYSTEM_H

#include "mck.h"

void mck_eliminate(int n, mck_real *matrix, mck_real *right);

#endif
