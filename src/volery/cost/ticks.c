/* The module volery.cost.ticks in C: the same class and the same counts as ticks.py, whose docstrings apply. */

#define PY_SSIZE_T_CLEAN
#include <Python.h>

typedef struct {
    PyObject_HEAD
    long long sum;
} Ticks;

/* What a counter adds, and to which sum. */
typedef struct {
    PyObject_HEAD
    Ticks *ticks;
    long long weight;
} Counter;

static PyTypeObject TicksType, CounterType;

static PyObject *count(Counter *counter, PyObject *Py_UNUSED(none))
{
    counter->ticks->sum += counter->weight;
    Py_RETURN_NONE;
}

static PyMethodDef count_method = {"count", (PyCFunction)count, METH_NOARGS, NULL};

static PyObject *ticks_counter(Ticks *ticks, PyObject *weight)
{
    long long value = PyLong_AsLongLong(weight);
    if (value == -1 && PyErr_Occurred())
        return NULL;
    Counter *counter = PyObject_New(Counter, &CounterType);
    if (counter == NULL)
        return NULL;
    counter->ticks = (Ticks *)Py_NewRef(ticks);
    counter->weight = value;
    PyObject *function = PyCFunction_New(&count_method, (PyObject *)counter);
    Py_DECREF(counter);
    return function;
}

static PyObject *ticks_take(Ticks *ticks, PyObject *Py_UNUSED(none))
{
    long long taken = ticks->sum;
    ticks->sum = 0;
    return PyLong_FromLongLong(taken);
}

static void counter_dealloc(Counter *counter)
{
    Py_DECREF(counter->ticks);
    PyObject_Free(counter);
}

static PyMethodDef ticks_methods[] = {
    {"counter", (PyCFunction)ticks_counter, METH_O, NULL},
    {"take", (PyCFunction)ticks_take, METH_NOARGS, NULL},
    {NULL},
};

static PyTypeObject TicksType = {
    PyVarObject_HEAD_INIT(NULL, 0)
    .tp_name = "volery.cost.ticks.Ticks",
    .tp_basicsize = sizeof(Ticks),
    .tp_flags = Py_TPFLAGS_DEFAULT,
    .tp_new = PyType_GenericNew,
    .tp_methods = ticks_methods,
};

static PyTypeObject CounterType = {
    PyVarObject_HEAD_INIT(NULL, 0)
    .tp_name = "volery.cost.ticks.Counter",
    .tp_basicsize = sizeof(Counter),
    .tp_flags = Py_TPFLAGS_DEFAULT,
    .tp_dealloc = (destructor)counter_dealloc,
};

static PyModuleDef module = {PyModuleDef_HEAD_INIT, .m_name = "volery.cost.ticks", .m_size = -1};

PyMODINIT_FUNC PyInit_ticks(void)
{
    if (PyType_Ready(&TicksType) < 0 || PyType_Ready(&CounterType) < 0)
        return NULL;
    PyObject *made = PyModule_Create(&module);
    if (made != NULL && PyModule_AddObjectRef(made, "Ticks", (PyObject *)&TicksType) < 0)
        Py_CLEAR(made);
    return made;
}
