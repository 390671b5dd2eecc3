/* Numbers as text, without locale and without an allocation: what encoders write many of.

A number is rounded to so many decimals, as Python's `round` rounds it: to the nearest, of the exact value, and to the
even digit where both are as near. Trailing zeros are left out, one decimal stays (1.0) unless it is left out too (1).
There is no minus before a zero. */
#ifndef ROVER_DIGITS_H
#define ROVER_DIGITS_H

#include <stdint.h>

#define DIGITS_INTERFACE 3 /* whatever changes below changes this */
#define DIGITS_MOST_DECIMALS 15
#define DIGITS_WIDEST 20 /* bytes of a number: 16 digits, or a zero and 15 decimals; sign, point, and a comma */
#define DIGITS_MOST_COLUMNS 32
#define DIGITS_SLACK 64 /* bytes behind the last one that may be written to */

/* One column: float64 in one piece with their decimals, or texts with a comma after each. Behind the last comma eight
bytes more must be there to be read. `point`: 1.0, not 1. */
typedef struct {
    const double *values;
    const char *text;
    int64_t decimals, point;
} digits_column;

/* What stands before, between and after the columns of a row. Sixteen bytes must be there to be read. */
typedef struct {
    const char *text;
    int64_t size;
} digits_piece;

/* What a line has in one place. With `values`: a list of row `i`, the first `counts[i]` of its `width` numbers, or all
without counts. Else the text of row `i`, which is before the comma at `ends[i]` and behind the one at `ends[i - 1]`;
sixteen bytes more must be there to be read. */
typedef struct {
    const double *values;
    const int64_t *counts;
    const char *text;
    const int64_t *ends;
    int64_t width, decimals;
} digits_place;

int64_t digits_interface(void);

/* Writes the lines from row `first` on: of each the pieces with its places between them. Returns what `digits_table`
does, for any number of places. */
int64_t digits_lines(const digits_place *places, const digits_piece *pieces, int64_t count, int64_t first, int64_t rows,
                     char *to);

/* Writes `rows` lines of `count` columns and `count + 1` pieces. Returns how many bytes, or -1 for a number that is none
or so large that its last decimal cannot be told (2^51 of them), and for more than DIGITS_MOST_COLUMNS columns. */
int64_t digits_table(const digits_column *columns, const digits_piece *pieces, int64_t count, int64_t rows, char *to);

/* Writes [[1.5,2.0],[3.25]]: of each row of `width` numbers the first `counts[row]`, or all without counts. Returns what
`digits_table` does. */
int64_t digits_lists(const double *values, int64_t rows, int64_t width, const int64_t *counts, int64_t decimals, char *to);

/* Writes [1.5,2.0]. Returns what `digits_table` does. */
int64_t digits_list(const double *values, int64_t count, int64_t decimals, char *to);

/* The CRC-32 of ZIP archives (zlib's) of these bytes behind others, of which it is `before`, 0 for none. -1 where the
processor has no instruction for it. */
int64_t digits_checksum(const void *from, int64_t size, int64_t before);

#endif
