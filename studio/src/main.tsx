import { StrictMode } from 'react';
import { createRoot } from 'react-dom/client';
import { takeTokenFromAddress } from './api/token';
import { App } from './app';
import { connect } from './store';
import './style.css';
import { applyTheme } from './theme';

applyTheme();
takeTokenFromAddress();
connect();
createRoot(document.getElementById('root')!).render(
  <StrictMode>
    <App />
  </StrictMode>,
);
