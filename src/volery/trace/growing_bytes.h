/* Bytes that grow at their end, for the modules of this package in C. */

#ifndef VOLERY_GROWING_BYTES_H
#define VOLERY_GROWING_BYTES_H

#define PY_SSIZE_T_CLEAN
#include <Python.h>

/* Times are read by PyLong_AsLong, digit by digit; PyLong_AsLongLong reads them byte by byte. */
_Static_assert(sizeof(long) == 8, "a time in ns has 64 bits");

typedef struct {
    char *bytes;
    Py_ssize_t used, room;
} Buffer;

/* Return the end of the bytes, with room for `more`; NULL with an exception. */
static inline char *reserve(Buffer *buffer, Py_ssize_t more)
{
    if (buffer->room - buffer->used < more) {
        Py_ssize_t room = 2 * buffer->room + more;
        char *bytes = PyMem_Realloc(buffer->bytes, room);
        if (bytes == NULL)
            return (char *)PyErr_NoMemory();
        buffer->bytes = bytes;
        buffer->room = room;
    }
    return buffer->bytes + buffer->used;
}

/* Return a string as UTF-8, NULL with an exception. Lone surrogates become question marks: then the text is that
 * of `replaced`, which the caller releases in any case. */
static inline const char *utf8(PyObject *text, Py_ssize_t *size, PyObject **replaced)
{
    *replaced = NULL;
    const char *bytes = PyUnicode_AsUTF8AndSize(text, size);
    if (bytes != NULL || !PyErr_ExceptionMatches(PyExc_UnicodeEncodeError))
        return bytes;
    PyErr_Clear();
    *replaced = PyUnicode_AsEncodedString(text, "utf-8", "replace");
    if (*replaced == NULL)
        return NULL;
    *size = PyBytes_GET_SIZE(*replaced);
    return PyBytes_AS_STRING(*replaced);
}

#endif
