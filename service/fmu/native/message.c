/* Messages without the C library's formatting, which knows languages with decimal commas. */
#include <stdarg.h>
#include <string.h>

#include "fmu.h"

typedef struct {
    char text[600];
    size_t length;
} message;

/* FMI 2 has messages formatted once more, and replaces what stands between two '#': neither may come from us. */
static void add(message *to, const char *text)
{
    for (; *text && to->length + 1 < sizeof to->text; text++)
        to->text[to->length++] = *text == '%' || *text == '#' ? '?' : *text;
    to->text[to->length] = 0;
}

static void add_digits(message *to, uint64_t digits, int least)
{
    char reversed[24], text[25];
    int count = 0;
    for (; digits || count < least; digits /= 10)
        reversed[count++] = (char)('0' + digits % 10);
    for (int i = 0; i < count; i++)
        text[i] = reversed[count - 1 - i];
    text[count] = 0;
    add(to, text);
}

/* About nine digits */
static void add_number(message *to, double number)
{
    if (number != number) {
        add(to, "NaN");
        return;
    }
    if (number < 0.0) {
        add(to, "-");
        number = -number;
    }
    if (number > 1.7e308) {
        add(to, "infinity");
        return;
    }
    int power = 0;
    for (; number >= 1e9; power++)
        number /= 10.0;
    for (; number < 1e8 && number > 0.0 && power > -350; power--)
        number *= 10.0;
    uint64_t digits = (uint64_t)(number + 0.5);
    for (; digits && digits % 10 == 0; power++)
        digits /= 10;
    uint64_t one = 1;
    if (power >= 0 && power <= 9) {
        for (int i = 0; i < power; i++)
            one *= 10;
        add_digits(to, digits * one, 1);
    } else if (power < 0 && power >= -13) {
        for (int i = 0; i < -power; i++)
            one *= 10;
        add_digits(to, digits / one, 1);
        add(to, ".");
        add_digits(to, digits % one, -power);
    } else {
        add_digits(to, digits, 1);
        add(to, power < 0 ? "e-" : "e+");
        add_digits(to, (uint64_t)(power < 0 ? -power : power), 1);
    }
}

int fmu_refuse(const fmu *instance, const char *function, const char *format, ...)
{
    message said = {.length = 0};
    va_list arguments;
    add(&said, function);
    add(&said, ": ");
    va_start(arguments, format);
    for (char one[2] = {0}; *format; format++) {
        one[0] = *format;
        if (*format != '%' || !format[1])
            add(&said, one);
        else if (*++format == 's')
            add(&said, va_arg(arguments, const char *));
        else if (*format == 'u')
            add_digits(&said, va_arg(arguments, unsigned int), 1);
        else
            add_number(&said, va_arg(arguments, double));
    }
    va_end(arguments);
    if (instance->log)
        instance->log(instance, FMU_ERROR, "logStatusError", said.text);
    return FMU_ERROR;
}
