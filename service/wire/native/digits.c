#include "digits.h"

#include "number.h"

#define BLOCK 64 /* numbers that are rounded before they are written */

int64_t digits_interface(void)
{
    return DIGITS_INTERFACE;
}

static int whole(const double *values, int64_t count, int64_t decimals, int64_t *to)
{
    double scale = (double)powers[decimals];
    return rounded(values, count, scale, to) || rounded_exactly(values, count, scale, to);
}

/* With a comma after each; 0 for a number that cannot be written. */
static char *listed(const double *values, int64_t count, int64_t decimals, char *to)
{
    int64_t numbers[BLOCK];
    for (int64_t begin = 0; begin < count; begin += BLOCK) {
        int64_t size = count - begin < BLOCK ? count - begin : BLOCK;
        if (!whole(values + begin, size, decimals, numbers))
            return 0;
        for (int64_t i = 0; i < size; i++) {
            to = decimals == USUAL ? usual(to, numbers[i], 1) : unusual(to, numbers[i], decimals, 1);
            *to++ = ',';
        }
    }
    return to;
}

/* [1.5,2.0] */
static char *bracketed(const double *values, int64_t count, int64_t decimals, char *to)
{
    *to++ = '[';
    to = listed(values, count, decimals, to);
    if (!to)
        return 0;
    to -= count > 0;
    *to++ = ']';
    return to;
}

int64_t digits_list(const double *values, int64_t count, int64_t decimals, char *to)
{
    char *end = bracketed(values, count, decimals, to);
    return end ? end - to : -1;
}

int64_t digits_lists(const double *values, int64_t rows, int64_t width, const int64_t *counts, int64_t decimals, char *to)
{
    char *at = to;
    *at++ = '[';
    for (int64_t row = 0; row < rows; row++) {
        at = bracketed(values + row * width, counts ? counts[row] : width, decimals, at);
        if (!at)
            return -1;
        *at++ = ',';
    }
    at -= rows > 0;
    *at++ = ']';
    return at - to;
}

/* Sixteen at a time: most pieces have fewer. */
static inline char *bytes(char *to, const char *from, int64_t size)
{
    memcpy(to, from, 16);
    if (__builtin_expect(size > 16, 0))
        memcpy(to + 16, from + 16, (size_t)(size - 16));
    return to + size;
}

static inline char *piece(char *to, const digits_piece *piece)
{
    return bytes(to, piece->text, piece->size);
}

/* The bytes of a word that are commas, as their highest bits; the first of them is right, and that is what is asked. */
static inline uint64_t commas_of(uint64_t word)
{
#if __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
    word = __builtin_bswap64(word);
#endif
    word ^= 0x2c2c2c2c2c2c2c2cull;
    return (word - 0x0101010101010101ull) & ~word & 0x8080808080808080ull;
}

/* Copies up to the next comma, and moves the text behind it. */
static inline char *copied(char *to, const char **text)
{
    for (const char *from = *text;; from += 8, to += 8) {
        uint64_t word;
        memcpy(&word, from, 8);
        memcpy(to, &word, 8);
        uint64_t commas = commas_of(word);
        if (commas) {
            int64_t size = __builtin_ctzll(commas) >> 3;
            *text = from + size + 1;
            return to + size;
        }
    }
}

typedef struct {
    const char *text; /* what is left of it */
    int64_t numbers[BLOCK];
} column_state;

static char *lines(const digits_column *columns, column_state *states, const digits_piece *pieces, int64_t count,
                   int64_t rows, char *to)
{
    for (int64_t row = 0; row < rows; row++) {
        for (int64_t k = 0; k < count; k++) {
            const digits_column *column = columns + k;
            to = piece(to, pieces + k);
            if (column->text)
                to = copied(to, &states[k].text);
            else if (column->decimals == USUAL)
                to = usual(to, states[k].numbers[row], column->point);
            else
                to = unusual(to, states[k].numbers[row], column->decimals, column->point);
        }
        to = piece(to, pieces + count);
    }
    return to;
}

static int is(const digits_piece *piece, char text)
{
    return piece->size == 1 && piece->text[0] == text;
}

/* Whether it is one of a text and numbers with USUAL decimals, with commas between them, each line ended. */
static int is_plain(const digits_column *columns, const digits_piece *pieces, int64_t count)
{
    int plain = count > 1 && columns->text && !pieces->size && is(pieces + count, '\n');
    for (int64_t k = 1; k < count; k++)
        plain &= is(pieces + k, ',') && !columns[k].text && columns[k].decimals == USUAL && columns[k].point;
    return plain;
}

/* Such a table: without a choice for each number it takes two thirds of the time, and less where the count is known. */
ALWAYS int64_t plain(const digits_column *columns, int64_t count, int64_t rows, char *to)
{
    int64_t numbers[DIGITS_MOST_COLUMNS][BLOCK];
    const char *text = columns->text;
    char *at = to;
    for (int64_t begin = 0; begin < rows; begin += BLOCK) {
        int64_t size = rows - begin < BLOCK ? rows - begin : BLOCK;
        for (int64_t k = 1; k < count; k++)
            if (!whole(columns[k].values + begin, size, USUAL, numbers[k]))
                return -1;
        for (int64_t row = 0; row < size; row++) {
            at = copied(at, &text);
            for (int64_t k = 1; k < count; k++) {
                *at++ = ',';
                at = usual(at, numbers[k][row], 1);
            }
            *at++ = '\n';
        }
    }
    return at - to;
}

int64_t digits_table(const digits_column *columns, const digits_piece *pieces, int64_t count, int64_t rows, char *to)
{
    column_state states[DIGITS_MOST_COLUMNS];
    char *at = to;
    if (count > DIGITS_MOST_COLUMNS)
        return -1;
    if (is_plain(columns, pieces, count))
        return count == 3 ? plain(columns, 3, rows, to) : plain(columns, count, rows, to);
    for (int64_t k = 0; k < count; k++)
        states[k].text = columns[k].text;
    for (int64_t begin = 0; begin < rows; begin += BLOCK) {
        int64_t size = rows - begin < BLOCK ? rows - begin : BLOCK;
        for (int64_t k = 0; k < count; k++)
            if (!columns[k].text && !whole(columns[k].values + begin, size, columns[k].decimals, states[k].numbers))
                return -1;
        at = lines(columns, states, pieces, count, size, at);
    }
    return at - to;
}

static char *placed(char *to, const digits_place *place, int64_t row)
{
    if (place->values) {
        int64_t count = place->counts ? place->counts[row] : place->width;
        return bracketed(place->values + row * place->width, count, place->decimals, to);
    }
    int64_t begin = row ? place->ends[row - 1] + 1 : 0;
    return bytes(to, place->text + begin, place->ends[row] - begin);
}

int64_t digits_lines(const digits_place *places, const digits_piece *pieces, int64_t count, int64_t first, int64_t rows,
                     char *to)
{
    char *at = to;
    for (int64_t row = first; row < first + rows; row++) {
        for (int64_t k = 0; k < count; k++) {
            at = placed(piece(at, pieces + k), places + k, row);
            if (!at)
                return -1;
        }
        at = piece(at, pieces + count);
    }
    return at - to;
}
